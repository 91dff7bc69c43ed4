// @ts-check
// The sessions in the data folder, and the files of one.

import { fileUrl, get } from "./api.js";
import { make, part } from "./dom.js";

/**
 * Asks for the list and shows it.
 * @param {(error: unknown) => void} complain
 * @returns {Promise<any[]>} The sessions, the newest first.
 */
export async function showSessions(complain) {
  /** @type {any[]} */
  let sessions;
  try {
    sessions = await get("/sessions");
  } catch (error) {
    complain(error);
    return [];
  }
  part("no-sessions").hidden = sessions.length > 0;
  part("sessions").replaceChildren(...sessions.map((session) => sessionItem(session, complain)));
  return sessions;
}

/**
 * One session, whose files are asked for when it is opened.
 * @param {any} session
 * @param {(error: unknown) => void} complain
 */
function sessionItem(session, complain) {
  const about = [];
  if (session.created) about.push(new Date(session.created).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" }));
  // While a run writes it, what is on the disk is not yet what it will be.
  if (["capturing", "computing"].includes(session.state)) about.push(session.state);
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
      const { frames = [], products = [] } = await get(`/sessions/${encodeURIComponent(session.name)}`);
      item.append(files(session.name, "products", products), files(session.name, "frames", frames));
    } catch (error) {
      delete item.dataset.asked;
      complain(error);
    }
  });
  return make("li", {}, item);
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
