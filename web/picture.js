// @ts-check
// The last captured view: the grain cut out of it, or the whole picture.

import { fileUrl, previewUrl } from "./api.js";
import { part, write } from "./dom.js";

/** What the picture shows: `grain` or `whole`. */
let part_shown = "grain";
/** @typedef {{ url: string, name: string, alt: string }} Picture */
/**
 * The picture that is to be shown, the address of the one that is, and whether one is on its way.
 * @type {Picture|null}
 */
let frame_wanted = null;
let frame_shown = "";
let frame_loading = false;

/**
 * Lets a person choose what the picture shows.
 * @param {() => void} changed
 */
export function chooseParts(changed) {
  const parts = /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-part]"));
  for (const choice of parts) {
    choice.addEventListener("click", () => {
      part_shown = choice.dataset.part ?? "whole";
      for (const one of parts) one.setAttribute("aria-pressed", String(one === choice));
      changed();
    });
  }
}

/**
 * Shows the status' last view.
 * @param {import("./status.js").Status} status
 */
export function showPicture(status) {
  const link = /** @type {HTMLAnchorElement} */ (part("frame-link"));
  const { session, last_frame } = status;
  if (session === null || last_frame === null) {
    frame_wanted = null;
    frame_shown = "";
    write(part("frame-name"), "");
    part("frame").hidden = true;
    part("frame").removeAttribute("src");
    part("no-frame").hidden = false;
    write(part("no-frame"), "No view captured yet.");
    write(part("frame-about"), "");
    link.removeAttribute("href");
    return;
  }
  link.href = fileUrl(session, "frames", last_frame);
  const alt = `The grain in view ${(status.view ?? 0) + 1} at ${status.angle_deg?.toFixed(1) ?? "?"}°`;
  frame_wanted = { url: previewUrl(session, last_frame, part_shown), name: last_frame, alt };
  const how = part_shown === "grain" ? "Cut out around the grain" : "Made small for the screen";
  write(part("frame-about"), `${how}; click it for the original.`);
  void loadFrame();
}

/**
 * Loads the wanted picture and then puts it in the other's place. One at a time: where pictures come faster
 * than they load, some are left out, rather than each breaking off the one before it.
 */
async function loadFrame() {
  if (frame_loading) return;
  frame_loading = true;
  while (frame_wanted !== null && frame_wanted.url !== frame_shown) {
    const { url, name, alt } = frame_wanted;
    const next = Object.assign(document.createElement("img"), { id: "frame", src: url, alt });
    next.dataset.testid = "last-frame";
    const problem = await next.decode().then(() => "", () => "The picture cannot be shown.");
    // Another run may have begun meanwhile, which has none yet.
    if (frame_wanted === null) break;
    frame_shown = url;
    next.hidden = problem !== "";
    part("frame").replaceWith(next);
    write(part("frame-name"), name);
    part("no-frame").hidden = problem === "";
    write(part("no-frame"), problem);
  }
  frame_loading = false;
}
