// @ts-check
// The picture that was refused last, with its cause: what is wrong is mostly to be seen.

import { rejectedUrl } from "./api.js";
import { part, write } from "./dom.js";

/** @param {import("./status.js").Status} status */
export function showRejected({ session, rejected }) {
  part("rejected").hidden = rejected === null || session === null;
  if (rejected === null || session === null) return;
  const { view, tries, cause } = rejected;
  const url = rejectedUrl(session, view, tries);
  write(part("rejected-name"), `view ${view + 1}, picture ${tries}`);
  write(part("rejected-cause"), cause);
  /** @type {HTMLAnchorElement} */ (part("rejected-link")).href = url;
  const picture = /** @type {HTMLImageElement} */ (part("rejected-picture"));
  if (picture.getAttribute("src") === url) return;
  picture.hidden = false;
  picture.onerror = () => (picture.hidden = true);
  picture.alt = `The refused picture of view ${view + 1}`;
  picture.src = url;
}
