// @ts-check
// The monitor page: shows the run as the daemon's events tell it, and hands on what a person wants.

import { ApiError, post, resumeUrl } from "./api.js";
import { draw } from "./chart.js";
import { listenToPress, offerSessions, showPress } from "./compress.js";
import { showJobs } from "./jobs.js";
import { make, part, write } from "./dom.js";
import { clearFault, tellFault } from "./fault.js";
import { duration, figure, headlines, leaves, line, nextName, stageName, volume } from "./format.js";
import { chooseParts, showPicture } from "./picture.js";
import { showRejected } from "./rejected.js";
import { files, grading, showSessions } from "./sessions.js";
import { fold, idle } from "./status.js";
import { judge } from "./verdict.js";
import { watch } from "./watch.js";

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
/** When the daemon was last heard, by this computer's clock; meant only while it is not. */
let heard_at_ms = 0;
/** The buttons whose request has no answer yet. */
const asked = /** @type {Set<string>} */ (new Set());
let rendering = false;

/** Renders once for all events that come in one turn: after a reconnection there may be hundreds. */
function show() {
  if (rendering) return;
  rendering = true;
  requestAnimationFrame(() => {
    rendering = false;
    showRun();
    showPicture(status);
    showRejected(status);
    showHull();
    showResult();
    showControls();
  });
}

function showRun() {
  const state = part("state");
  write(state, STATE_NAMES[status.state] ?? status.state);
  state.dataset.state = status.state;
  const verdict = status.state === "complete" ? judge(status.result) : null;
  state.dataset.verdict = verdict?.grade ?? "none";
  part("verdict").hidden = verdict === null;
  if (verdict) part("verdict").replaceChildren(...grading(verdict));
  document.title = `${state.textContent}${verdict ? `, ${verdict.grade}` : ""} – grainrig`;
  write(part("session"), status.session ?? "");
  write(part("doing"), doing());
  const progress = /** @type {HTMLProgressElement} */ (part("progress"));
  const computing = status.state === "computing" && status.stage !== null;
  progress.max = computing ? 1 : Math.max(status.views, 1);
  progress.value = computing ? (status.stage?.done ?? 0) : Math.min(status.captured, progress.max);
  progress.setAttribute("aria-label", computing ? stageName(status.stage?.name ?? "") : "Views captured");
  progress.dataset.state = status.state;
  progress.dataset.verdict = state.dataset.verdict;
  write(part("step"), status.views > 0 ? `${status.captured} of ${status.views}` : "–");
  write(part("angle"), status.angle_deg === null ? "–" : `${status.angle_deg.toFixed(1)}°`);
  showRemaining();
  const error = part("run-error");
  error.hidden = status.error === null;
  write(error, status.error ?? "");
  part("warnings-card").hidden = status.warnings.length === 0;
  part("warnings").replaceChildren(
    ...status.warnings.map(({ view, verdict, text }) =>
      make("li", { "data-verdict": verdict ?? "none" }, make("b", {}, `View ${view + 1} `), badge(verdict), text),
    ),
  );
}

/**
 * The mark of a view that is not good.
 * @param {import("./status.js").Verdict|null} verdict
 */
function badge(verdict) {
  return make("span", { class: "verdict" }, verdict === null || verdict === "good" ? "" : `${verdict} `);
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
      return status.error === null
        ? "The stage rests until the run is resumed."
        : "Suspended: once the cause is mended, Resume takes the view again.";
    case "computing":
      return status.stage ? `${stageName(status.stage.name)}, ${Math.round(status.stage.done * 100)} %` : "All views are captured.";
    case "complete":
      return "All views are captured and the products are written.";
    case "aborted":
      return "What was captured stays on disk; Resume goes on with it.";
    case "failed":
      return "What was captured stays on disk; once the cause is mended, Resume goes on.";
    default:
      return "";
  }
}

function showRemaining() {
  const { remaining_s, state } = status;
  // Nothing is known of what happens while the daemon is not heard.
  const now_ms = connected ? Date.now() : Math.max(heard_at_ms, estimated_at_ms);
  let text = "–";
  if (remaining_s !== null && state === "paused") text = duration(remaining_s);
  else if (remaining_s !== null) text = duration(remaining_s - (now_ms - estimated_at_ms) / 1000);
  write(part("remaining"), text);
}

function showHull() {
  const newest = status.hull.at(-1);
  const found = finished();
  let shown = "–";
  let how = "";
  if (found?.estimate && found.interval) {
    shown = volume(found.estimate);
    how = `the grain’s, between ${figure(found.interval[0])} and ${volume(found.interval[1])}; of the hull, an upper bound, ${volume(found.volume)}`;
  } else if (found) {
    shown = volume(found.volume);
    how = "of the finished hull: an upper bound";
    if (found.unknown) how += `; the grain’s own can’t be told: ${found.unknown}`;
  } else if (newest) {
    // One view bounds nothing along its own direction.
    if (typeof newest.volume_mm3 === "number") shown = volume(newest.volume_mm3);
    how = `from ${newest.views} silhouette${newest.views === 1 ? "" : "s"} so far, coarsely; an upper bound`;
  }
  write(part("volume"), shown);
  write(part("volume-how"), how);
  drawHull();
}

/**
 * What the result says of the hull; `null` before there is one, or where the cameras have no unit.
 * @returns {import("./chart.js").Finished|null}
 */
function finished() {
  const hull = /** @type {any} */ (status.result)?.hull;
  if (typeof hull?.volume_mm3 !== "number") return null;
  return {
    volume: hull.volume_mm3,
    estimate: hull.volume_estimate_mm3 ?? null,
    interval: hull.volume_interval_mm3 ?? null,
    unknown: hull.volume_unknown ?? null,
    convergence: hull.convergence ?? [],
  };
}

const drawHull = () => draw(part("chart"), status.hull, status.views, finished());

function showResult() {
  const all = status.result === null ? [] : leaves(status.result).filter(({ path }) => !/^(view_details\.|products\.outline_)/.test(path));
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
  const ready = (/** @type {string} */ id) => connected && !asked.has(id);
  const enable = (/** @type {string} */ id, /** @type {boolean} */ on) => {
    /** @type {HTMLButtonElement} */ (part(id)).disabled = !(ready(id) && on);
  };
  enable("start-button", !active);
  enable("pause", state === "starting" || state === "running");
  enable("resume", state === "paused" || isUnfinished(status));
  // A mesh that is being made ends by itself.
  enable("abort", active && state !== "computing");
  showPress(status.compression, ready);
  showJobs(status.jobs, want);
}

/**
 * Whether the last run ended before its session was complete.
 * @param {Status} status
 */
const isUnfinished = ({ state, session }) => session !== null && (state === "aborted" || state === "failed");

/** Asks for the sessions, shows them, and offers those that can be compressed. */
async function refreshSessions() {
  const sessions = await showSessions({ over: isUnfinished(status) ? status.session : null, want });
  if (sessions !== null) offerSessions(sessions, status.session);
}

/** @param {RigEvent} event */
function note(event) {
  // A compression tells its own, but that it waits.
  if (event.event === "job" && event.kind === "compress" && event.state !== "waiting") return;
  const log = part("log");
  log.hidden = false;
  part("no-log").hidden = true;
  const time = make("time", { datetime: event.time }, new Date(event.time).toLocaleTimeString("en-GB"));
  // A stage's progress is one line that counts on, and so is a computation's.
  const counting = { working: () => event.stage, compression: () => `${event.session}/${event.name}`, job: () => `job ${event.job}` };
  const stage = counting[/** @type {keyof typeof counting} */ (event.event)]?.() ?? null;
  const before = [...log.children].slice(0, 3).find((item) => stage !== null && /** @type {HTMLElement} */ (item).dataset.stage === stage);
  before?.remove();
  const item = make("li", { "data-seq": String(event.seq), "data-kind": event.event }, time, line(event));
  if (stage !== null) item.dataset.stage = stage;
  log.prepend(item);
  while (log.children.length > LOG_LINES) log.lastElementChild?.remove();
}

/**
 * Asks the daemon for something; a second click before the answer does nothing.
 * @param {string} path
 * @param {object} by
 * @param {string} by.button The id of the button that asks.
 * @param {string} by.fault The id of the paragraph that tells of a failure.
 * @param {unknown} [by.body]
 * @param {(error: unknown) => HTMLElement|null} [by.cause] The field that a refusal speaks of.
 * @returns {Promise<boolean>} Whether it was done.
 */
async function want(path, { button, fault, body, cause }) {
  if (asked.has(button)) return false;
  asked.add(button);
  clearFault(fault);
  showControls();
  try {
    await post(path, body);
    return true;
  } catch (error) {
    tellFault(fault, error, cause?.(error) ?? document.getElementById(button));
    if (error instanceof ApiError && error.kind === "unauthorised") part("locked").hidden = false;
    return false;
  } finally {
    asked.delete(button);
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
    const cause = (/** @type {unknown} */ error) => (error instanceof ApiError && error.kind === "invalid" ? name : null);
    void want("/runs", { button: "start-button", fault: "start-fault", body: { name: taken }, cause }).then((begun) => {
      // Unless somebody has typed another meanwhile.
      if (begun && name.value === taken) name.value = nextName(taken);
    });
  });
  const steer = (/** @type {string} */ button, path = `/runs/current/${button}`) => void want(path, { button, fault: "control-fault" });
  part("pause").addEventListener("click", () => steer("pause"));
  part("resume").addEventListener("click", () => {
    if (isUnfinished(status)) steer("resume", resumeUrl(status.session ?? ""));
    else steer("resume");
  });
  const sure = /** @type {HTMLDialogElement} */ (part("sure"));
  part("abort").addEventListener("click", () => {
    sure.returnValue = "keep";
    sure.showModal();
  });
  sure.addEventListener("close", () => {
    if (sure.returnValue === "abort") steer("abort");
  });
  chooseParts(show);
  listenToPress(want);
  new ResizeObserver(drawHull).observe(part("chart"));
  setInterval(showRemaining, 1000);
}

listen();
show();
watch({
  snapshot(now, at_ms) {
    status = now;
    estimated_at_ms = at_ms;
    show();
    void refreshSessions();
  },
  event(event) {
    status = fold(status, event);
    if (event.event === "captured" || event.event === "resumed") estimated_at_ms = Date.now();
    note(event);
    show();
    const made = event.event === "job" && event.state === "complete" && ["reconstruct", "replay", "merge"].includes(event.kind);
    if (made || ["started", "aborted", "failed", "complete"].includes(event.event)) void refreshSessions();
  },
  connection(kind, heard_ms) {
    connected = kind === "live";
    heard_at_ms = heard_ms;
    document.body.classList.toggle("stale", !connected);
    const pill = part("connection");
    pill.dataset.kind = kind;
    const heard = connected || heard_ms === 0 ? "" : `, last heard ${new Date(heard_ms).toLocaleTimeString("en-GB")}`;
    write(pill, CONNECTIONS[kind] + heard);
    showRemaining();
    part("locked").hidden = kind !== "locked";
    showControls();
  },
});
