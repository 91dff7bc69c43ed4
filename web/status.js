// @ts-check
// Where the run stands: the browser's half of src/server/status.rs. web/test/fold.json holds both to the
// same answers.

/** @typedef {"idle"|"starting"|"running"|"paused"|"computing"|"complete"|"aborted"|"failed"} RunState */
/** @typedef {"good"|"doubtful"|"bad"} Verdict */
/** @typedef {{ views: number, volume_mm3: number|null }} HullPoint */
/** @typedef {{ approach_mm: number, force_n: number }} CurvePoint */
/**
 * @typedef {object} Compression
 * @property {string} session
 * @property {string} name
 * @property {"meshing"|"running"|"complete"|"cancelled"|"interrupted"|"failed"} state
 * @property {string} [phase] What is being done before the plates move.
 * @property {number} done
 * @property {number|null} left_s
 * @property {number} contacts
 * @property {CurvePoint[]} curve
 * @property {string|null} error
 */
/**
 * A computation beside the rig.
 * @typedef {object} Job
 * @property {number} job
 * @property {"reconstruct"|"replay"|"verify"|"merge"|"compress"|"import"|"mesh"|"calibrate_scale"|"study"|"rests"|"ensemble"} kind
 * @property {string} session Or the file or folder that it is about.
 * @property {string} [name] Of a session's compression.
 * @property {"waiting"|"running"|"complete"|"cancelled"|"interrupted"|"failed"} state
 * @property {string} [phase] What is being done.
 * @property {number} done
 * @property {string|null} error
 */
/**
 * @typedef {object} Status
 * @property {RunState} state
 * @property {string|null} session
 * @property {number} views
 * @property {number} captured
 * @property {number|null} view
 * @property {number|null} angle_deg
 * @property {number|null} remaining_s
 * @property {string|null} last_frame
 * @property {HullPoint[]} hull
 * @property {{ name: string, done: number }|null} stage
 * @property {{ view: number, verdict: Verdict|null, text: string }[]} warnings
 * @property {{ view: number, tries: number, cause: string }|null} rejected
 * @property {string[]} products
 * @property {unknown} result
 * @property {string|null} error
 * @property {Compression|null} compression
 * @property {Job[]} jobs
 */
/** @typedef {{ seq: number, time: string, event: string, [field: string]: any }} RigEvent */

/** As in status.rs. */
const WARNINGS_KEPT = 200;
const HULL_POINTS_KEPT = 2000;
const CURVE_POINTS_KEPT = 4000;
const ENDED_JOBS_KEPT = 20;

/** @returns {Status} Nothing happened yet. */
export function idle() {
  return {
    state: "idle",
    session: null,
    views: 0,
    captured: 0,
    view: null,
    angle_deg: null,
    remaining_s: null,
    last_frame: null,
    hull: [],
    stage: null,
    warnings: [],
    rejected: null,
    products: [],
    result: null,
    error: null,
    compression: null,
    jobs: [],
  };
}

/** Whether a computation waits or goes on. */
export const isUnderWay = (/** @type {Job} */ { state }) => state === "waiting" || state === "running";

/**
 * The computations beside the rig after some news of one.
 * @param {Job[]} before
 * @param {any} news
 */
function computed(before, news) {
  const { job, kind, session, name, state, phase, done, error } = news;
  const now = { job, kind, session, ...(name === undefined ? {} : { name }), state, ...(phase === undefined ? {} : { phase }), done, error };
  const known = before.some((one) => one.job === job);
  const jobs = known ? before.map((one) => (one.job === job ? now : one)) : [...before, now];
  const ended = jobs.filter((one) => !isUnderWay(one));
  return ended.length > ENDED_JOBS_KEPT ? jobs.filter((one) => one !== ended[0]) : jobs;
}

/**
 * The compression after some news of it, or of the next one.
 * @param {Compression|null} before
 * @param {any} news
 * @returns {Compression}
 */
function compressed(before, news) {
  const { session, name, state, phase, done, left_s, contacts, from, points, error } = news;
  const same = before !== null && before.session === session && before.name === name;
  let curve = same ? before.curve.slice(0, from) : [];
  if (curve.length === from) curve = [...curve, ...points].slice(0, CURVE_POINTS_KEPT);
  const setUp = phase === undefined ? {} : { phase };
  return { session, name, state, ...setUp, done, left_s, contacts, curve, error };
}

/**
 * The warnings with those of one more view.
 * @param {Status} before
 * @param {number} view
 * @param {Verdict|null} verdict
 * @param {string[]} texts
 */
function more(before, view, verdict, texts) {
  return [...before.warnings, ...texts.map((text) => ({ view, verdict, text }))].slice(0, WARNINGS_KEPT);
}

/**
 * The status after one more event.
 * @param {Status} before
 * @param {Omit<RigEvent, "seq"|"time">} event
 * @returns {Status}
 */
export function fold(before, event) {
  const leaving = (/** @type {RunState} */ state) => (before.state === "starting" ? state : before.state);
  const ended = (/** @type {RunState} */ state) => ({ ...before, state, remaining_s: null, stage: null });
  switch (event.event) {
    case "started":
      return {
        ...idle(),
        state: "starting",
        session: event.session,
        views: event.views,
        captured: event.already_captured,
        compression: before.compression,
        jobs: before.jobs,
      };
    case "homed":
      return { ...before, state: leaving("running") };
    case "moving":
      return { ...before, state: leaving("running"), view: event.view, angle_deg: event.target_deg };
    case "captured": {
      // A view is kept while the stage is on its way to a later one.
      const there = before.view === null || before.view <= event.view;
      return {
        ...before,
        captured: before.captured + 1,
        rejected: before.rejected?.view === event.view ? null : before.rejected,
        view: there ? event.view : before.view,
        angle_deg: there ? event.reached_deg : before.angle_deg,
        remaining_s: event.remaining_s,
        last_frame: event.file,
      };
    }
    case "paused":
      return { ...before, state: "paused" };
    case "resumed":
      return { ...before, state: "running", error: null };
    case "suspended":
      return { ...before, error: event.cause };
    case "aborted":
      return ended("aborted");
    case "acquisition_complete":
      return { ...before, state: "computing", remaining_s: null };
    case "silhouette":
    case "judged":
      return { ...before, warnings: more(before, event.view, event.verdict ?? null, event.warnings) };
    case "rejected":
      return {
        ...before,
        warnings: more(before, event.view, "bad", [event.cause]),
        // Without a number it is a picture that was kept.
        rejected: event.tries ? { view: event.view, tries: event.tries, cause: event.cause } : before.rejected,
      };
    case "hull": {
      const point = { views: event.views, volume_mm3: event.volume_mm3 };
      return { ...before, hull: [...before.hull, point].slice(0, HULL_POINTS_KEPT) };
    }
    case "working":
      return { ...before, state: leaving("computing"), stage: { name: event.stage, done: event.done } };
    case "products":
      return { ...before, products: event.files.map((/** @type {{ file: string }} */ product) => product.file) };
    case "failed":
      return { ...ended("failed"), error: event.error };
    case "complete":
      return { ...ended("complete"), result: event.result };
    case "compression":
      return { ...before, compression: compressed(before.compression, event) };
    case "job":
      return { ...before, jobs: computed(before.jobs, event) };
    default:
      // A newer daemon's event changes nothing that this page knows to show.
      return before;
  }
}
