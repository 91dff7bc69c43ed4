// @ts-check
// Numbers and events as a person reads them.

/** @typedef {import("./status.js").RigEvent} RigEvent */

/** Units by the ending of a field's name, as the daemon's conventions have them; the longer first. */
const UNITS = /** @type {[string, string][]} */ ([
  ["_mm_per_px", "mm/px"], ["_mm3", "mm³"], ["_mm2", "mm²"], ["_mm", "mm"], ["_um", "µm"], ["_px2", "px²"],
  ["_px", "px"], ["_deg", "°"], ["_rad", "rad"], ["_s", "s"], ["_n", "N"], ["_mpa", "MPa"], ["_percent", "%"],
]);

/**
 * Four significant digits, grouped; whole numbers whole.
 * @param {number} value
 */
export function number(value) {
  if (Number.isInteger(value)) return value.toLocaleString("en-GB");
  if (value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e7)) return value.toExponential(3);
  return value.toLocaleString("en-GB", { maximumSignificantDigits: 4 });
}

/** @param {number} seconds */
export function duration(seconds) {
  const whole = Math.max(0, Math.round(seconds));
  if (whole < 60) return `${whole} s`;
  const minutes = Math.floor(whole / 60);
  if (minutes < 60) return `${minutes} min ${String(whole % 60).padStart(2, "0")} s`;
  return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

/** @param {number|null} volume_mm3 */
export const volume = (volume_mm3) => (volume_mm3 === null ? "no scale" : `${figure(volume_mm3)} mm³`);

/**
 * Four significant digits, the last ones too where they are noughts: a measured figure.
 * @param {number} value
 */
export function figure(value) {
  if (Number.isInteger(value) || Math.abs(value) < 1e-4 || Math.abs(value) >= 1000) return number(value);
  return value.toPrecision(4);
}

/** @typedef {{ path: string, label: string, value: string }} Leaf */

/**
 * Every number and text in a result, with its place, in the result's own order.
 * @param {unknown} value
 * @param {string[]} [path]
 * @returns {Leaf[]}
 */
export function leaves(value, path = []) {
  if (Array.isArray(value)) {
    const plain = value.every((item) => typeof item !== "object" || item === null);
    if (!plain) return value.flatMap((item, index) => leaves(item, [...path, String(index + 1)]));
    const shown = value.slice(0, 12).map((item) => (typeof item === "number" ? number(item) : String(item)));
    if (value.length > shown.length) shown.push(`… (${value.length})`);
    return [leaf(path, shown.join(", ") || "none")];
  }
  if (value !== null && typeof value === "object") {
    return Object.entries(value).flatMap(([key, item]) => leaves(item, [...path, key]));
  }
  if (typeof value === "number") return [leaf(path, figure(value))];
  return [leaf(path, value === null || value === undefined ? "–" : String(value))];
}

/**
 * @param {string[]} path
 * @param {string} shown
 * @returns {Leaf}
 */
function leaf(path, shown) {
  // The unit may be a field's or that of the group it stands in: `dihedral_deg.min`.
  let unit = "";
  const words = path.map((name) => {
    const ending = UNITS.find(([ending]) => name.toLowerCase().endsWith(ending));
    if (ending) unit = ending[1];
    return (ending ? name.slice(0, -ending[0].length) : name).replaceAll("_", " ");
  });
  return { path: path.join("."), label: words.join(" · "), value: withUnit(shown, unit) };
}

/**
 * @param {string} shown
 * @param {string} unit
 */
function withUnit(shown, unit) {
  if (unit === "" || shown === "–") return shown;
  return unit === "°" ? `${shown}°` : `${shown} ${unit}`;
}

/** The figures that stand large: what they are, where the result has them, and how they were got. */
const HEADLINES = /** @type {[string, string, string][]} */ ([
  ["Grain’s volume", "hull.volume_estimate_mm3", "best estimate: the hull less what silhouettes can’t show"],
  ["Volume, least and most", "hull.volume_interval_mm3", "holds the grain’s volume in 95 of 100 captures"],
  ["Grain’s volume", "hull.volume_unknown", "neither an estimate nor bounds can be given: the hull’s volume is all that is known"],
  ["Hull’s volume", "hull.volume_mm3", "of the visual hull: an upper bound"],
  ["Surface area", "hull.surface_area_mm2", "of the visual hull"],
  ["Agreement", "hull.silhouette_iou.min", "worst view: hull seen again over silhouette"],
  ["Nodes", "mesh.nodes", "of the tetrahedral mesh"],
  ["Tetrahedra", "mesh.tetrahedra", "in the mesh"],
  ["Mesh volume", "mesh.volume_mm3", "of the tetrahedra together"],
  ["Smallest dihedral", "mesh.dihedral_deg.min", "angle between faces of a tetrahedron"],
  ["Radius–edge ratio", "mesh.radius_edge.max", "worst tetrahedron; 0.61 is regular"],
]);

/**
 * @param {Leaf[]} all
 * @returns {{ label: string, value: string, how: string }[]}
 */
export function headlines(all) {
  return HEADLINES.flatMap(([label, path, how]) => {
    // What a result has no value for is no headline: of estimate and why there is none one is always null.
    const found = all.find((one) => one.path === path && one.value !== "–");
    // Two ends of a range, not a list.
    const range = path.includes("interval");
    return found ? [{ label, value: range ? found.value.replace(", ", " to ") : found.value, how }] : [];
  });
}

/** What a stage of the computation is called on the page. */
const STAGES = /** @type {Record<string, string>} */ ({
  calibrate: "Finding the axis",
  hull: "Carving the hull",
  mesh: "Meshing",
  silhouettes: "Finding silhouettes",
  export: "Writing files",
});

/** @param {string} stage */
export const stageName = (stage) => STAGES[stage] ?? stage;

/** What a state of a compression is called on the page. */
const COMPRESSION = /** @type {Record<string, string>} */ ({
  complete: "Complete",
  cancelled: "Cancelled",
  interrupted: "Interrupted",
  failed: "Failed",
});

/**
 * @param {string} state
 * @param {number} done
 * @param {string} [phase] What is being done before the plates move.
 */
export function compressing(state, done, phase) {
  if (state === "meshing") return phase ? phase[0].toUpperCase() + phase.slice(1) : "Meshing";
  return COMPRESSION[state] ?? `${Math.floor(100 * done)} %`;
}

/** What a computation beside the rig is called on the page. */
const JOBS = /** @type {Record<string, (of: any) => string>} */ ({
  reconstruct: ({ session }) => `Hull and mesh of ${session}`,
  replay: ({ session }) => `Replay of ${session}`,
  verify: ({ session }) => `Check of ${session}`,
  merge: ({ session }) => `Merging to ${session}`,
  compress: ({ session, name }) => (name ? `Compression ${name} of ${session}` : `Compression of ${session}`),
  import: ({ session }) => `Import of ${session}`,
  mesh: ({ session }) => `Mesh of ${session}`,
  calibrate_scale: ({ session }) => `Size of a pixel from ${session}`,
  ensemble: ({ session }) => `Ensemble of ${session}`,
  study: ({ session }) => `Study ${session}`,
  rests: ({ session }) => `Rests of ${session}`,
});

/**
 * A computation beside the rig, and how it stands.
 * @param {import("./status.js").Job} job
 */
export function computing(job) {
  const how = job.state === "running" && job.phase ? `${stageName(job.phase)}${job.done > 0 ? `, ${Math.floor(100 * job.done)} %` : ""}` : job.state;
  return `${JOBS[job.kind]?.(job) ?? job.kind}: ${how}${job.error ? `: ${job.error}` : ""}`;
}

/**
 * The next run's name: `grain-07` → `grain-08`, `quartz` → `quartz-2`.
 * @param {string} name
 */
export function nextName(name) {
  const [, stem, digits] = /^(.*?)-(\d{1,4})$/.exec(name) ?? [];
  const next = digits === undefined ? `${name}-2` : `${stem}-${String(Number(digits) + 1).padStart(digits.length, "0")}`;
  return next.length <= 64 ? next : name;
}

/**
 * One line for the log.
 * @param {RigEvent} event
 */
export function line(event) {
  const view = () => `View ${event.view + 1}`;
  switch (event.event) {
    case "started":
      return event.already_captured > 0
        ? `Run ${event.session} goes on at ${event.already_captured} of ${event.views} views`
        : `Run ${event.session} began: ${event.views} views`;
    case "homed":
      return "Stage found its reference";
    case "moving":
      return `${view()}: moving to ${event.target_deg.toFixed(1)}°`;
    case "captured":
      return `${view()} captured at ${event.reached_deg.toFixed(2)}°: ${event.file}, ${number(Math.round(event.bytes / 1024))} KiB`;
    case "paused":
      return "Paused";
    case "resumed":
      return "Resumed";
    case "aborted":
      return "Aborted; what was captured stays";
    case "acquisition_complete":
      return `All ${event.views} views captured`;
    case "silhouette":
      return `${view()}: silhouette of ${number(Math.round(event.area_px))} px²` + event.warnings.map((/** @type {string} */ text) => `; ${text}`).join("");
    case "judged":
      return `${view()} does not fit its neighbours: ${event.warnings.join("; ")}`;
    case "rejected":
      return `${view()}${event.tries ? `, picture ${event.tries}` : ""} is no good: ${event.cause}`;
    case "suspended":
      return `Suspended at view ${event.view + 1}: ${event.cause}`;
    case "hull":
      if (event.volume_mm3 === null) return `Hull of ${event.views} view${event.views === 1 ? "" : "s"}`;
      return `Hull of ${event.views} views: ${volume(event.volume_mm3)}`;
    case "working":
      if (event.done <= 0) return `${stageName(event.stage)} …`;
      return `${stageName(event.stage)}: ${event.done < 1 ? `${Math.round(event.done * 100)} %` : "done"}`;
    case "products":
      return `${event.files.length} files written`;
    case "failed":
      return `Failed: ${event.error}`;
    case "complete":
      return "Run complete";
    case "compression":
      return `Compression ${event.name} of ${event.session}: ${compressing(event.state, event.done, event.phase)}${event.error ? `: ${event.error}` : ""}`;
    case "job":
      return computing(/** @type {any} */ (event));
    default:
      return event.event;
  }
}
