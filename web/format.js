// @ts-check
// Numbers and events as a person reads them.

/** @typedef {import("./status.js").RigEvent} RigEvent */

/** Units by the ending of a field's name, as the daemon's conventions have them. */
const UNITS = /** @type {[string, string][]} */ ([
  ["_mm3", "mm³"], ["_mm2", "mm²"], ["_mm", "mm"], ["_um", "µm"], ["_px", "px"], ["_deg", "°"], ["_rad", "rad"],
  ["_s", "s"], ["_n", "N"], ["_mpa", "MPa"], ["_percent", "%"],
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
export const volume = (volume_mm3) => (volume_mm3 === null ? "no scale" : `${number(volume_mm3)} mm³`);

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
  if (typeof value === "number") return [leaf(path, number(value))];
  return [leaf(path, value === null || value === undefined ? "–" : String(value))];
}

/**
 * @param {string[]} path
 * @param {string} shown
 * @returns {Leaf}
 */
function leaf(path, shown) {
  const name = path.join(".");
  const unit = UNITS.find(([ending]) => name.toLowerCase().endsWith(ending));
  const bare = unit ? name.slice(0, -unit[0].length) : name;
  const value = !unit || shown === "–" ? shown : unit[1] === "°" ? `${shown}°` : `${shown} ${unit[1]}`;
  return { path: name, label: bare.replaceAll("_", " ").replaceAll(".", " · "), value };
}

/** The figures that stand large, each by the first place in the result that fits. */
const HEADLINES = /** @type {[string, RegExp][]} */ ([
  ["Volume", /volume_mm3$/],
  ["Surface area", /(?<!projected_)area_mm2$/],
  ["Nodes", /(^|[._])nodes$/],
  ["Tetrahedra", /(^|[._])(tets|tetrahedra|elements)$/],
  ["Worst quality", /(min(imum)?|worst)_(\w+_)?(quality|dihedral\w*|radius_edge\w*)$|quality[._](min|worst)\w*$/],
]);

/**
 * @param {Leaf[]} all
 * @returns {{ label: string, value: string, path: string }[]}
 */
export function headlines(all) {
  return HEADLINES.flatMap(([label, place]) => {
    const found = all.find((one) => place.test(one.path));
    return found ? [{ label, value: found.value, path: found.path }] : [];
  });
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
    case "hull":
      return `Hull of ${event.views} views: ${volume(event.volume_mm3)}`;
    case "working":
      return `${event.stage}: ${Math.round(event.done * 100)} %`;
    case "products":
      return `${event.files.length} files written`;
    case "failed":
      return `Failed: ${event.error}`;
    case "complete":
      return "Run complete";
    default:
      return event.event;
  }
}
