// @ts-check
// The sessions in the data folder, and the files of one.

import { fileUrl, get, rejectedUrl, resumeUrl } from "./api.js";
import { make, part } from "./dom.js";
import { clearFault, tellFault } from "./fault.js";
import { GRADES, judge } from "./verdict.js";

/** @typedef {(path: string, by: { button: string, fault: string, body?: unknown }) => Promise<boolean>} Want */

/**
 * Asks for the list and shows it.
 * @param {object} by
 * @param {string|null} by.over The session whose run has just ended unfinished, though the daemon may still be letting go of it.
 * @param {Want} by.want
 * @returns {Promise<any[]|null>} The sessions, the newest first; `null` where they could not be had.
 */
export async function showSessions({ over, want }) {
  /** @type {any[]} */
  let sessions;
  try {
    sessions = await get("/sessions");
  } catch (error) {
    tellFault("sessions-fault", error);
    return null;
  }
  clearFault("sessions-fault");
  part("no-sessions").hidden = sessions.length > 0;
  part("sessions").replaceChildren(...sessions.map((session) => sessionItem(session.name === over ? { ...session, busy: false } : session, want)));
  return sessions;
}

/**
 * One session, whose files are asked for when it is opened.
 * @param {any} session
 * @param {Want} want
 */
function sessionItem(session, want) {
  const about = [];
  if (session.created) about.push(new Date(session.created).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" }));
  // While a run writes it, what is on the disk is not yet what it will be.
  if (session.busy && ["capturing", "computing"].includes(session.state)) about.push(session.state);
  else {
    if (session.planned) about.push(`${session.captured ?? "?"} of ${session.planned} views`);
    if (session.state) about.push(String(session.state).replaceAll("_", " "));
    if (session.busy) about.push("in use");
  }
  const summary = make("summary", {}, make("b", {}, session.name), make("span", { class: "hint" }, about.join(" · ")));
  const item = make("details", {}, summary);
  if (session.damage) item.append(make("p", { class: "run-error" }, session.damage));
  item.addEventListener("toggle", async () => {
    if (!(/** @type {HTMLDetailsElement} */ (item).open) || item.dataset.asked) return;
    item.dataset.asked = "yes";
    try {
      const { frames = [], products = [], rejected = [], result } = await get(`/sessions/${encodeURIComponent(session.name)}`);
      const verdict = judge(result);
      if (verdict) item.append(make("div", { class: "grading" }, ...grading(verdict)));
      item.append(files(session.name, "products", products), files(session.name, "frames", frames));
      item.append(...rejected.map((/** @type {any} */ one) => refused(session.name, one)));
      if (!session.busy) item.append(again(session, want));
    } catch (error) {
      delete item.dataset.asked;
      tellFault("sessions-fault", error);
    }
  });
  const unfinished = session.state && session.state !== "complete";
  if (!unfinished || session.busy || session.damage) return make("li", {}, item);
  const id = `resume-${session.name}`;
  const resume = make("button", { type: "button", class: "quiet", id, "aria-label": `Resume ${session.name}` }, "Resume");
  resume.addEventListener("click", () => void want(resumeUrl(session.name), { button: id, fault: "sessions-fault" }));
  return make("li", { class: "unfinished" }, item, resume);
}

/**
 * What can be computed from a session's recording.
 * @param {any} session
 * @param {Want} want
 */
function again(session, want) {
  const button = (/** @type {string} */ kind, /** @type {string} */ text, /** @type {string} */ title) => {
    const id = `${kind}-${session.name}`;
    const made = make("button", { type: "button", class: "quiet", id, title, "aria-label": `${text}, ${session.name}` }, text);
    made.addEventListener("click", () => void want("/jobs", { button: id, fault: "sessions-fault", body: { kind, session: session.name } }));
    return made;
  };
  const check = button("verify", "Check files", "Compares every file with the hash in the journal");
  if (session.state !== "complete") return make("p", {}, check);
  const replay = button("replay", "Replay", "Computes everything again from the recording, and writes products that are lost");
  return make("p", {}, check, " ", replay);
}

/**
 * A picture that was refused, by its cause.
 * @param {string} session
 * @param {{ view: number, tries: number, cause: string }} one
 */
function refused(session, { view, tries, cause }) {
  return make("p", { class: "hint" }, make("a", { href: rejectedUrl(session, view, tries) }, `Refused picture of view ${view + 1}`), `: ${cause}`);
}

/**
 * A verdict with its reasons, and what else is to be known.
 * @param {import("./verdict.js").Grading} verdict
 */
export function grading({ grade, reasons, warnings }) {
  const { mark, word } = GRADES[grade];
  const count = (/** @type {string[]} */ list, /** @type {string} */ name) => (list.length === 0 ? [] : [`${list.length} ${name}${list.length > 1 ? "s" : ""}`]);
  const counts = [...count(reasons, "reason"), ...count(warnings, "warning")].join(", ");
  const why = counts || "the views agree with one another and with one grain";
  const title = make("p", { "data-grade": grade }, make("span", { "aria-hidden": "true" }, `${mark} `), make("b", {}, word), `: ${why}`);
  const lines = [...reasons, ...warnings];
  return lines.length === 0 ? [title] : [title, make("ul", { class: "lines" }, ...lines.map((line) => make("li", {}, line)))];
}

/**
 * @param {string} session
 * @param {"frames"|"products"} folder
 * @param {{ file: string }[]} list
 */
export function files(session, folder, list) {
  if (list.length === 0) return make("p", { class: "hint" }, `No ${folder}.`);
  return links(list, (file) => fileUrl(session, folder, file), (file) => isDrawn(folder, file));
}

/**
 * Files by their names, drawings among them as pictures.
 * @param {{ file: string }[]} list
 * @param {(file: string) => string} url
 * @param {(file: string) => boolean} isDrawn
 */
export function links(list, url, isDrawn) {
  const link = (/** @type {string} */ file, /** @type {Node | string} */ shown) =>
    make("li", {}, make("a", { href: url(file), ...saved(file) }, shown));
  const [drawn, others] = [true, false].map((is) => list.map(({ file }) => file).filter((file) => isDrawn(file) === is));
  const names = make("ul", { class: "files" }, ...others.map((file) => link(file, file)));
  if (drawn.length === 0) return names;
  const picture = (/** @type {string} */ file) =>
    make("img", { src: url(file), alt: file, title: file, loading: "lazy" });
  return make("div", {}, names, make("ul", { class: "drawn" }, ...drawn.map((file) => link(file, picture(file)))));
}

/**
 * Whether a file is a drawing that is shown, not only named: an outline over its photograph, the calibration's sheet.
 * @param {"frames"|"products"} folder
 * @param {string} file
 */
function isDrawn(folder, file) {
  return folder === "products" && /^(outline_\d+|calibration)\.png$/.test(file);
}

/**
 * A mesh is saved, not shown: a browser would choke on its text.
 * @param {string} file
 * @returns {Record<string, string>}
 */
function saved(file) {
  return /\.(inp|vtu|stl|ply|glb|csv)$/.test(file) ? { download: file } : {};
}
