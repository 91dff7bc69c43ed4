// @ts-check
// What could not be done, told where it was asked for.

import { part, write } from "./dom.js";

/** Where each place stands while it belongs to no field. */
const homes = /** @type {Map<HTMLElement, { parent: Element, next: Element|null }>} */ (new Map());

/**
 * Tells of a failure in a place of its own beside what caused it: in sight, where a person has caused it.
 * @param {string} place The paragraph's id.
 * @param {unknown} error
 * @param {HTMLElement|null} [control] What caused it: a field, or the button.
 */
export function tellFault(place, error, control = null) {
  clearFault(place);
  const told = part(place);
  const { parentElement: parent, nextElementSibling: next } = told;
  if (parent !== null && !homes.has(told)) homes.set(told, { parent, next });
  const home = homes.get(told);
  home?.parent.insertBefore(told, home.next);
  write(told, error instanceof Error ? error.message : String(error));
  told.hidden = false;
  if (control !== null) {
    control.setAttribute("aria-describedby", [control.getAttribute("aria-describedby"), place].filter(Boolean).join(" "));
    if (control.matches("input, select")) {
      control.setAttribute("aria-invalid", "true");
      control.closest("details")?.setAttribute("open", "");
      // Below its field, wherever that stands.
      control.closest(".field")?.after(told);
      control.focus({ preventScroll: true });
    }
    told.scrollIntoView({ block: "center" });
  }
}

/**
 * Takes it back.
 * @param {string} place
 */
export function clearFault(place) {
  part(place).hidden = true;
  for (const control of document.querySelectorAll(`[aria-describedby~="${place}"]`)) {
    const others = (control.getAttribute("aria-describedby") ?? "").split(" ").filter((id) => id !== place);
    if (others.length > 0) control.setAttribute("aria-describedby", others.join(" "));
    else control.removeAttribute("aria-describedby");
    control.removeAttribute("aria-invalid");
  }
}

/**
 * The field of a form that a refusal speaks of: the first whose name is in it as a word.
 * @param {HTMLFormElement} form
 * @param {unknown} error
 * @returns {HTMLElement|null}
 */
export function fieldOf(form, error) {
  const text = error instanceof Error ? error.message : String(error);
  const named = /** @type {(HTMLInputElement|HTMLSelectElement)[]} */ ([...form.querySelectorAll("[name]")]);
  const places = named.map((field) => ({ field, at: text.search(new RegExp(`\\b${field.name}\\b`)) }));
  const found = places.filter(({ at }) => at >= 0).sort((a, b) => a.at - b.at)[0];
  return found?.field ?? null;
}
