// @ts-check
// The compression panel: a grain is pressed between two plates, and what came out of it.

import { compressionUrl, get } from "./api.js";
import { drawCurve } from "./curve.js";
import { make, part, write } from "./dom.js";
import { clearFault, fieldOf, tellFault } from "./fault.js";
import { compressing, duration, figure, number } from "./format.js";
import { links } from "./sessions.js";

/** @typedef {import("./status.js").Compression} Compression */
/** @typedef {{ session: string, name: string }} Named */

/** @type {Compression|null} The compression that the daemon is at, or the last one. */
let live = null;
/** @type {Compression|null} What is shown: the live one, or an earlier one that was asked for. */
let shown = null;
/** What the shown one's results were asked for, so that they are asked for once. */
let asked = "";
/** @type {{ result: any, files: { file: string }[] }|null} The shown one's results. */
let results = null;
/** Whether the daemon can be asked by the button of that name. */
let ready = (/** @type {string} */ _button) => false;
/** Whether a person has chosen the session, rather than the run that ended last. */
let chosen = false;

const session = () => /** @type {HTMLSelectElement} */ (part("press-session"));
const goesOn = (/** @type {Compression|null} */ one) => one !== null && ["meshing", "running"].includes(one.state);
const same = (/** @type {Named|null} */ a, /** @type {Named|null} */ b) => a?.session === b?.session && a?.name === b?.name;

/**
 * @param {(path: string, by: { button: string, fault: string, body?: unknown, cause?: (error: unknown) => HTMLElement|null }) => Promise<boolean>} want
 */
export function listenToPress(want) {
  const form = /** @type {HTMLFormElement} */ (part("press-form"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    // What is being begun is what a person wants to see.
    const cause = (/** @type {unknown} */ error) => fieldOf(form, error);
    void want(compressionUrl(session().value), { button: "press-start", fault: "press-fault", body: request(form), cause }).then((begun) => (begun ? look(live) : undefined));
  });
  part("press-material").addEventListener("change", showYield);
  session().addEventListener("change", () => {
    chosen = true;
    void showEarlier();
  });
  const steer = (/** @type {string} */ button, /** @type {string} */ path) => void want(path, { button, fault: "press-control-fault" });
  part("press-cancel").addEventListener("click", () => steer("press-cancel", "/compressions/current/cancel"));
  part("press-resume").addEventListener("click", () => {
    if (shown) steer("press-resume", `${compressionUrl(shown.session, shown.name)}/resume`);
  });
  new ResizeObserver(() => drawCurve(part("press-chart"), shown?.curve ?? [])).observe(part("press-chart"));
}

/**
 * What the form asks for: a field that is empty is left to the daemon.
 * @param {HTMLFormElement} form
 */
function request(form) {
  const entries = [...new FormData(form)].filter(([, value]) => value !== "");
  return Object.fromEntries(entries.map(([name, value]) => [name, name === "material" ? value : Number(value)]));
}

function showYield() {
  const plastic = /** @type {HTMLSelectElement} */ (part("press-material")).value === "plastic";
  /** @type {HTMLInputElement} */ (part("press-yield")).disabled = !plastic;
}

/**
 * The sessions that can be compressed.
 * @param {any[]} sessions
 * @param {string|null} current The run's.
 */
export function offerSessions(sessions, current) {
  const complete = sessions.filter((one) => one.state === "complete" && !one.damage).map((one) => one.name);
  const before = session().value;
  session().replaceChildren(...complete.map((name) => make("option", { value: name }, name)));
  const wanted = chosen && complete.includes(before) ? before : complete.includes(current) ? current : complete[0];
  if (wanted !== undefined) session().value = wanted;
  part("press-form").hidden = complete.length === 0;
  part("no-grain").hidden = complete.length > 0;
  showYield();
  if (complete.length > 0) void showEarlier();
}

/** Lists the chosen session's compressions. */
async function showEarlier() {
  const of = session().value;
  // Before the list of sessions is there, none is chosen.
  if (of === "") return;
  /** @type {any[]} */
  let all = [];
  try {
    all = await get(compressionUrl(of));
    clearFault("press-earlier-fault");
  } catch (error) {
    tellFault("press-earlier-fault", error);
  }
  if (session().value !== of) return;
  part("press-earlier").hidden = all.length === 0;
  part("press-list").replaceChildren(
    ...all.map(({ name, state }) => {
      const button = make("button", { type: "button", class: "quiet" }, `${name}, ${state}`);
      button.addEventListener("click", () => void look({ session: of, name }));
      return make("li", {}, button);
    }),
  );
}

/**
 * Shows one of the compressions: the live one as it goes on, another one as it lies on the disk.
 * @param {Named|null} which
 */
async function look(which) {
  if (which === null || same(which, live)) {
    shown = live;
    show();
    return;
  }
  try {
    const { state, result } = await get(compressionUrl(which.session, which.name));
    const curve = result?.curve ?? [];
    shown = { ...which, state, done: state === "complete" ? 1 : 0, left_s: null, contacts: 0, curve, error: null };
    show();
    clearFault("press-earlier-fault");
  } catch (error) {
    tellFault("press-earlier-fault", error);
  }
}

/**
 * Shows where the compression stands.
 * @param {Compression|null} now
 * @param {(button: string) => boolean} may Whether the daemon can be asked by the button of that name.
 */
export function showPress(now, may) {
  const before = live;
  live = now;
  ready = may;
  // A new one takes the place of what was looked at.
  if (shown === null || same(shown, before) || !same(live, before)) shown = live;
  if (live && before?.state !== live.state) void showEarlier();
  show();
}

function show() {
  const one = shown;
  part("press").hidden = one === null;
  const enable = (/** @type {string} */ id, /** @type {boolean} */ on) => {
    /** @type {HTMLButtonElement} */ (part(id)).disabled = !(ready(id) && on);
  };
  enable("press-start", !goesOn(live));
  if (one === null) return;
  const active = goesOn(one);
  enable("press-cancel", active && same(one, live));
  enable("press-resume", !goesOn(live) && one.state !== "complete");
  write(part("press-name"), `${one.session}, ${one.name}`);
  const state = part("press-state");
  // The percents are the bar's: a screen reader is not told each.
  write(state, one.state === "running" ? "Pressing" : compressing(one.state, one.done, one.phase));
  state.dataset.state = one.state === "cancelled" || one.state === "interrupted" ? "paused" : one.state;
  const progress = /** @type {HTMLProgressElement} */ (part("press-progress"));
  progress.value = one.done;
  progress.dataset.state = one.state;
  const newest = one.curve.at(-1);
  const short = (/** @type {number} */ value) => number(Number(value.toPrecision(3)));
  write(part("press-force"), newest ? `${short(newest.force_n)} N` : "–");
  write(part("press-approach"), newest ? `${short(1000 * newest.approach_mm)} µm` : "–");
  write(part("press-left"), one.left_s === null ? "–" : duration(one.left_s));
  part("press-error").hidden = one.error === null;
  write(part("press-error"), one.error ?? "");
  drawCurve(part("press-chart"), one.curve);
  void showResults(one, active);
}

/**
 * The files and figures, once for each time that a compression has come to an end.
 * @param {Compression} one
 * @param {boolean} active
 */
async function showResults(one, active) {
  const key = active ? "" : `${one.session}/${one.name}/${one.state}`;
  if (key === asked) return;
  asked = key;
  results = null;
  part("press-results").hidden = true;
  part("press-verdict").hidden = true;
  part("press-state").dataset.verdict = "none";
  if (key === "") return;
  try {
    const answer = await get(compressionUrl(one.session, one.name));
    if (asked !== key) return;
    results = answer;
  } catch (error) {
    tellFault("press-control-fault", error);
  }
  drawResults(one);
}

/** @param {Compression} one */
function drawResults(one) {
  if (!results?.result) return;
  const { result, files } = results;
  const url = (/** @type {string} */ file) => compressionUrl(one.session, one.name, file);
  part("press-results").hidden = false;
  part("press-figures").replaceChildren(
    ...figures(result).map(([label, value, how]) =>
      make("div", {}, make("dt", {}, label), make("dd", {}, value), make("dd", { class: "hint" }, how)),
    ),
  );
  const doubts = result.warnings.length;
  part("press-state").dataset.verdict = doubts > 0 ? "doubtful" : "good";
  part("press-verdict").hidden = doubts === 0;
  write(part("press-verdict"), doubts === 0 ? "" : `! Doubtful: ${doubts} warning${doubts > 1 ? "s" : ""}, below the figures`);
  part("press-warnings").replaceChildren(...result.warnings.map((/** @type {string} */ text) => make("li", {}, text)));
  const sheet = /** @type {HTMLAnchorElement} */ (part("press-sheet"));
  const has = (/** @type {string} */ file) => files.some((one) => one.file === file);
  for (const id of ["press-sheet", "press-sheet-title"]) part(id).hidden = !has("curve.svg");
  sheet.href = url("curve.png");
  const picture = /** @type {HTMLImageElement} */ (sheet.firstElementChild);
  picture.alt = `Force, contacts, energy and rotation against the approach of the plates, of compression ${one.name}`;
  if (has("curve.svg")) picture.src = url("curve.svg");
  const cuts = files.filter(({ file }) => /^stage_\d+\.png$/.test(file));
  part("press-cuts-title").hidden = cuts.length === 0;
  part("press-cuts").replaceChildren(
    ...cuts.map(({ file }, index) =>
      make("a", { href: url(file) }, make("img", { src: url(file), alt: `Stress at stage ${index + 1} of ${cuts.length}`, loading: "lazy" })),
    ),
  );
  part("press-files").replaceChildren(links(files, url, () => false));
}

/**
 * What is not known of δ_i, where the run ended too early to tell.
 * @param {any} result
 * @returns {string}
 */
function preliminary(result) {
  const settled = !result.transition || result.transition.settled;
  return settled ? "" : "; preliminary: not known whether the force falls again";
}

/**
 * The figures that stand large: what, how much, how it was got.
 * @param {any} result
 * @returns {[string, string, string][]}
 */
function figures(result) {
  const out = /** @type {[string, string, string][]} */ ([]);
  const last = result.curve.at(-1);
  if (last) out.push(["Last force", `${figure(last.force_n)} N`, `at ${figure(1000 * last.approach_mm)} µm of approach`]);
  if (result.delta_i_mm !== null) {
    out.push(["δ_i", `${figure(1000 * result.delta_i_mm)} µm`, `approach at ${number(result.settings.transition_n)} N${preliminary(result)}`]);
  }
  if (result.hertz) out.push(["Hertz’ radius", `${figure(result.hertz.radius_mm)} mm`, "fitted after δ_i, at the material’s E*"]);
  out.push(["Contacts", number(result.contacts.length), "in all, formed and lost"]);
  out.push(["Rotation", `${figure(result.rotation_deg)}°`, "of the grain between the plates"]);
  out.push(["Tetrahedra", number(result.elements), `${number(result.steps)} steps in ${duration(result.wall_s)}`]);
  return out;
}
