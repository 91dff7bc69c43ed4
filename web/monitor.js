// @ts-check
// The monitor page: shows the run as the daemon's events tell it, and hands on what a person wants.

import { ApiError, fileUrl, follow, get, post, previewUrl } from "./api.js";
import { draw } from "./chart.js";
import { duration, headlines, leaves, line, nextName, stageName, volume } from "./format.js";
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
  progress.setAttribute("aria-label", computing ? stageName(status.stage?.name ?? "") : "Views captured");
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
      return status.stage ? `${stageName(status.stage.name)}, ${Math.round(status.stage.done * 100)} %` : "All views are captured.";
    case "complete":
      return "All views are captured and the products are written.";
    case "aborted":
      return `What was captured stays on disk; “grainrig resume ${status.session}” goes on with it.`;
    case "failed":
      return `What was captured stays on disk; once the cause is mended, “grainrig resume ${status.session}” goes on.`;
    default:
      return "";
  }
}

function showRemaining() {
  const { remaining_s, state } = status;
  let text = "–";
  if (remaining_s !== null && state === "paused") text = duration(remaining_s);
  else if (remaining_s !== null) text = duration(remaining_s - (performance.now() - estimated_at_ms) / 1000);
  write(part("remaining"), text);
}

function showFrame() {
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

function showHull() {
  const newest = status.hull.at(-1);
  const result = /** @type {any} */ (status.result)?.hull?.volume_mm3;
  if (result !== undefined) write(part("volume"), volume(result));
  // One view bounds nothing along its own direction.
  else write(part("volume"), typeof newest?.volume_mm3 === "number" ? volume(newest.volume_mm3) : "–");
  let how = "";
  if (result !== undefined) how = "of the finished hull: an upper bound";
  else if (newest) how = `from ${newest.views} silhouette${newest.views === 1 ? "" : "s"} so far, coarsely; an upper bound`;
  write(part("volume-how"), how);
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
  // A mesh that is being made ends by itself.
  enable("abort", active && state !== "computing");
}

/** @param {RigEvent} event */
function note(event) {
  const log = part("log");
  log.hidden = false;
  part("no-log").hidden = true;
  const time = make("time", { datetime: event.time }, new Date(event.time).toLocaleTimeString("en-GB"));
  // A stage's progress is one line that counts on.
  const newest = /** @type {HTMLElement|null} */ (log.firstElementChild);
  if (event.event === "working" && newest?.dataset.kind === "working" && newest.dataset.stage === event.stage) newest.remove();
  const item = make("li", { "data-seq": String(event.seq), "data-kind": event.event }, time, line(event));
  if (event.event === "working") item.dataset.stage = event.stage;
  log.prepend(item);
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
  // While a run writes it, what is on the disk is not yet what it will be.
  const unfinished = ["created", "interrupted", "captured"].includes(session.state);
  if (session.busy && unfinished) about.push("in progress");
  else {
    if (session.planned) about.push(`${session.captured ?? "?"} of ${session.planned} views`);
    if (session.state) about.push(String(session.state).replaceAll("_", " "));
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
function files(session, folder, list) {
  if (list.length === 0) return make("p", { class: "hint" }, `No ${folder}.`);
  return make(
    "ul",
    { class: "files" },
    ...list.map(({ file }) => make("li", {}, make("a", { href: fileUrl(session, folder, file), ...saved(file) }, file))),
  );
}

/**
 * A mesh is saved, not shown: a browser would choke on its text.
 * @param {string} file
 * @returns {Record<string, string>}
 */
function saved(file) {
  return /\.(inp|vtu|stl|ply|glb|csv)$/.test(file) ? { download: file } : {};
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
 * @returns {Promise<boolean>} Whether it was done.
 */
async function want(path, body) {
  asking = true;
  showControls();
  try {
    await post(path, body);
    part("problem").hidden = true;
    return true;
  } catch (error) {
    complain(error);
    if (error instanceof ApiError && error.kind === "unauthorised") part("locked").hidden = false;
    return false;
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
    const taken = name.value;
    void want("/runs", { name: taken }).then((begun) => {
      // Unless somebody has typed another meanwhile.
      if (begun && name.value === taken) name.value = nextName(taken);
    });
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
  const parts = /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-part]"));
  for (const choice of parts) {
    choice.addEventListener("click", () => {
      part_shown = choice.dataset.part ?? "whole";
      for (const one of parts) one.setAttribute("aria-pressed", String(one === choice));
      show();
    });
  }
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
