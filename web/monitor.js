// @ts-check
// The monitor page: shows the run as the daemon's events tell it, and hands on what a person wants.

import { ApiError, fileUrl, follow, get, post } from "./api.js";
import { draw } from "./chart.js";
import { duration, headlines, leaves, line, volume } from "./format.js";
import { fold, idle } from "./status.js";

/** @typedef {import("./status.js").Status} Status */
/** @typedef {import("./status.js").RigEvent} RigEvent */

/** Lines of the log that are kept. */
const LOG_LINES = 200;

/** @type {Record<import("./status.js").RunState, string>} */
const STATE_NAMES = {
  idle: "Ready",
  starting: "Starting",
  running: "Capturing",
  paused: "Paused",
  computing: "Computing",
  complete: "Complete",
  aborted: "Aborted",
  failed: "Failed",
};
const CONNECTIONS = { live: "Live", waiting: "Reconnecting", offline: "No connection", locked: "Locked" };

/** @type {Status} */
let status = idle();
/** When the estimate of the time left was made, by this computer's clock. */
let estimated_at_ms = 0;
let connected = false;
let asking = false;
let rendering = false;

/**
 * @template {HTMLElement} [E=HTMLElement]
 * @param {string} id
 * @returns {E}
 */
function part(id) {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`index.html has no #${id}`);
  return /** @type {E} */ (found);
}

/**
 * @param {string} tag
 * @param {Record<string, string>} attributes
 * @param {(Node|string)[]} children
 */
function make(tag, attributes, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/**
 * Changes a text only where it differs, so that a screen reader is not told the same twice.
 * @param {HTMLElement} place
 * @param {string} text
 */
function write(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

/** Renders once for all events that come in one turn: after a reconnection there may be hundreds. */
function show() {
  if (rendering) return;
  rendering = true;
  requestAnimationFrame(() => {
    rendering = false;
    showRun();
    showFrame();
    showHull();
    showResult();
    showControls();
  });
}

function showRun() {
  const state = part("state");
  write(state, STATE_NAMES[status.state] ?? status.state);
  state.dataset.state = status.state;
  document.title = `${state.textContent} – grainrig`;
  write(part("session"), status.session ?? "");
  write(part("doing"), doing());
  const progress = /** @type {HTMLProgressElement} */ (part("progress"));
  const computing = status.state === "computing" && status.stage !== null;
  progress.max = computing ? 1 : Math.max(status.views, 1);
  progress.value = computing ? (status.stage?.done ?? 0) : Math.min(status.captured, progress.max);
  progress.setAttribute("aria-label", computing ? `Computing: ${status.stage?.name}` : "Views captured");
  progress.dataset.state = status.state;
  write(part("step"), status.views > 0 ? `${status.captured} of ${status.views}` : "–");
  write(part("angle"), status.angle_deg === null ? "–" : `${status.angle_deg.toFixed(1)}°`);
  showRemaining();
  const error = part("run-error");
  error.hidden = status.error === null;
  write(error, status.error ?? "");
  part("warnings-card").hidden = status.warnings.length === 0;
  part("warnings").replaceChildren(
    ...status.warnings.map(({ view, text }) => make("li", {}, make("b", {}, `View ${view + 1} `), text)),
  );
}

/** What goes on, in a sentence. */
function doing() {
  const next = status.view === null ? "" : `view ${status.view + 1}`;
  switch (status.state) {
    case "idle":
      return "Name a run and start it.";
    case "starting":
      return "The stage looks for its reference.";
    case "running":
      return next && `At ${next}.`;
    case "paused":
      return "The stage rests until the run is resumed.";
    case "computing":
      return status.stage ? `${status.stage.name}, ${Math.round(status.stage.done * 100)} %` : "All views are captured.";
    case "complete":
      return "All views are captured and the products are written.";
    case "aborted":
      return "What was captured stays on disk.";
    case "failed":
      return "The run could not go on; what was captured stays on disk.";
    default:
      return "";
  }
}

function showRemaining() {
  const { remaining_s, state } = status;
  let text = "–";
  if (remaining_s !== null && state === "paused") text = `${duration(remaining_s)} (paused)`;
  else if (remaining_s !== null) text = duration(remaining_s - (performance.now() - estimated_at_ms) / 1000);
  write(part("remaining"), text);
}

function showFrame() {
  const image = /** @type {HTMLImageElement} */ (part("frame"));
  const link = /** @type {HTMLAnchorElement} */ (part("frame-link"));
  const there = status.session !== null && status.last_frame !== null;
  part("no-frame").hidden = there;
  write(part("no-frame"), "No view captured yet.");
  if (!there) {
    image.hidden = true;
    image.removeAttribute("src");
    link.removeAttribute("href");
    write(part("frame-name"), "");
    return;
  }
  const url = fileUrl(/** @type {string} */ (status.session), "frames", /** @type {string} */ (status.last_frame));
  if (image.getAttribute("src") === url) return;
  image.hidden = false;
  image.src = url;
  image.alt = `The grain in view ${(status.view ?? 0) + 1} at ${status.angle_deg?.toFixed(1) ?? "?"}°`;
  link.href = url;
  write(part("frame-name"), status.last_frame ?? "");
}

function showHull() {
  const newest = status.hull.at(-1);
  write(part("volume"), newest ? volume(newest.volume_mm3) : "–");
  const settled = status.state === "complete";
  write(part("volume-how"), newest ? `from ${newest.views} silhouettes${settled ? "" : " so far"}; an upper bound` : "");
  draw(part("chart"), status.hull, status.views);
}

function showResult() {
  const all = status.result === null ? [] : leaves(status.result).filter(({ path }) => !path.startsWith("view_details."));
  part("no-result").hidden = all.length > 0;
  part("headline").replaceChildren(
    ...headlines(all).map(({ label, value, how }) =>
      make("div", {}, make("dt", {}, label), make("dd", {}, value), make("dd", { class: "hint" }, how)),
    ),
  );
  part("all").hidden = all.length === 0;
  part("numbers").replaceChildren(
    ...all.map(({ label, value }) => make("tr", {}, make("th", { scope: "row" }, label), make("td", {}, value))),
  );
  part("products-title").hidden = status.products.length === 0;
  const list = status.products.map((file) => ({ file }));
  part("products").replaceChildren(...(list.length > 0 ? [files(status.session ?? "", "products", list)] : []));
}

function showControls() {
  const { state } = status;
  const active = ["starting", "running", "paused", "computing"].includes(state);
  const ready = connected && !asking;
  const enable = (/** @type {string} */ id, /** @type {boolean} */ on) => {
    /** @type {HTMLButtonElement} */ (part(id)).disabled = !(ready && on);
  };
  enable("start-button", !active);
  enable("pause", state === "starting" || state === "running");
  enable("resume", state === "paused");
  enable("abort", active);
}

/** @param {RigEvent} event */
function note(event) {
  const log = part("log");
  log.hidden = false;
  part("no-log").hidden = true;
  const time = make("time", { datetime: event.time }, new Date(event.time).toLocaleTimeString("en-GB"));
  log.prepend(make("li", { "data-seq": String(event.seq), "data-kind": event.event }, time, line(event)));
  while (log.children.length > LOG_LINES) log.lastElementChild?.remove();
}

async function showSessions() {
  /** @type {any[]} */
  let sessions;
  try {
    sessions = await get("/sessions");
  } catch (error) {
    complain(error);
    return;
  }
  part("no-sessions").hidden = sessions.length > 0;
  part("sessions").replaceChildren(...sessions.map(sessionItem));
}

/**
 * One session, whose files are asked for when it is opened.
 * @param {any} session
 */
function sessionItem(session) {
  const about = [];
  if (session.created) about.push(new Date(session.created).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" }));
  if (session.planned) about.push(`${session.captured ?? "?"} of ${session.planned} views`);
  if (session.state) about.push(String(session.state).replaceAll("_", " "));
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
function files(session, folder, list) {
  if (list.length === 0) return make("p", { class: "hint" }, `No ${folder}.`);
  return make(
    "ul",
    { class: "files" },
    ...list.map(({ file }) => make("li", {}, make("a", { href: fileUrl(session, folder, file) }, file))),
  );
}

/** @param {unknown} error */
function complain(error) {
  part("problem").hidden = false;
  write(part("problem-text"), error instanceof Error ? error.message : String(error));
}

/**
 * Asks the daemon for something; one request at a time, so that a second click does nothing.
 * @param {string} path
 * @param {unknown} [body]
 */
async function want(path, body) {
  asking = true;
  showControls();
  try {
    await post(path, body);
    part("problem").hidden = true;
  } catch (error) {
    complain(error);
    if (error instanceof ApiError && error.kind === "unauthorised") part("locked").hidden = false;
  } finally {
    asking = false;
    showControls();
  }
}

function listen() {
  const name = /** @type {HTMLInputElement} */ (part("name"));
  const now = new Date();
  const two = (/** @type {number} */ value) => String(value).padStart(2, "0");
  name.value = `grain-${now.getFullYear()}${two(now.getMonth() + 1)}${two(now.getDate())}-${two(now.getHours())}${two(now.getMinutes())}`;
  part("start").addEventListener("submit", (event) => {
    event.preventDefault();
    void want("/runs", { name: name.value });
  });
  part("pause").addEventListener("click", () => void want("/runs/current/pause"));
  part("resume").addEventListener("click", () => void want("/runs/current/resume"));
  const sure = /** @type {HTMLDialogElement} */ (part("sure"));
  part("abort").addEventListener("click", () => {
    sure.returnValue = "keep";
    sure.showModal();
  });
  sure.addEventListener("close", () => {
    if (sure.returnValue === "abort") void want("/runs/current/abort");
  });
  part("problem-close").addEventListener("click", () => (part("problem").hidden = true));
  part("frame").addEventListener("error", () => {
    part("frame").hidden = true;
    part("no-frame").hidden = false;
    write(part("no-frame"), "The browser cannot show this picture.");
  });
  new ResizeObserver(() => draw(part("chart"), status.hull, status.views)).observe(part("chart"));
  setInterval(showRemaining, 1000);
}

listen();
show();
follow({
  snapshot(now) {
    status = now;
    estimated_at_ms = performance.now();
    show();
    void showSessions();
  },
  event(event) {
    status = fold(status, event);
    if (event.event === "captured" || event.event === "resumed") estimated_at_ms = performance.now();
    note(event);
    show();
    if (["started", "aborted", "failed", "complete"].includes(event.event)) void showSessions();
  },
  connection(kind) {
    connected = kind === "live";
    const pill = part("connection");
    pill.dataset.kind = kind;
    write(pill, CONNECTIONS[kind]);
    part("locked").hidden = kind !== "locked";
    showControls();
  },
});
