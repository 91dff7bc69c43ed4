// @ts-check
// The hull's volume against the views that carved it.

import { number, volume } from "./format.js";

const SVG = "http://www.w3.org/2000/svg";
export const EDGE = { top: 14, right: 14, bottom: 34, left: 56 };

/**
 * @param {string} name
 * @param {Record<string, string|number>} attributes
 * @param {string} [text]
 */
export function element(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  if (text !== undefined) made.textContent = text;
  return made;
}

/**
 * Round numbers from at or below `low` to at or above `high`, about `count` of them.
 * @param {number} low
 * @param {number} high
 * @param {number} count
 */
export function ticks(low, high, count) {
  const span = high - low || Math.abs(high) || 1;
  const power = 10 ** Math.floor(Math.log10(span / count));
  const step = [1, 2, 2.5, 5, 10].map((factor) => factor * power).find((step) => span / step <= count) ?? span;
  const made = [];
  const first = Math.floor(low / step + 1e-9);
  const last = Math.max(Math.ceil(high / step - 1e-9), first + 1);
  for (let index = first; index <= last; index++) made.push(Number((index * step).toPrecision(12)));
  return made;
}

/**
 * The finished hull: its volume, the grain's as best estimated and between which it lies, and the volumes of hulls of
 * fewer views spread evenly.
 * @typedef {{ volume: number, estimate: number|null, interval: [number, number]|null, unknown?: string|null, convergence: import("./status.js").HullPoint[] }} Finished
 */

/**
 * Draws the chart into `place`, at its present width: while views come in, the volume of the hull so far; once there is a
 * result, the volume against the number of views and where the grain's own volume lies.
 * @param {HTMLElement} place
 * @param {import("./status.js").HullPoint[]} hull
 * @param {number} planned Views in the plan.
 * @param {Finished|null} finished
 */
export function draw(place, hull, planned, finished) {
  const found = finished !== null && finished.convergence.length > 1;
  const points = (found ? finished.convergence : hull).flatMap(({ views, volume_mm3 }) => (volume_mm3 === null ? [] : [{ views, volume_mm3 }]));
  const interval = found ? finished.interval : null;
  const width = Math.max(place.clientWidth, 240);
  const height = Math.round(Math.min(Math.max(width * 0.46, 180), 300));
  const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img" });
  const newest = points.at(-1);
  let title = newest
    ? `Hull volume against views: ${volume(points[0].volume_mm3)} after ${points[0].views}, ${volume(newest.volume_mm3)} after ${newest.views}`
    : "Hull volume against views: none yet";
  if (interval) title += `; the grain’s own lies between ${volume(interval[0])} and ${volume(interval[1])}`;
  svg.append(element("title", {}, title));

  const most = Math.max(planned, newest?.views ?? 0, 1);
  const volumes = [...points.map((point) => point.volume_mm3), ...(interval ?? [])];
  const grid = points.length > 0 ? ticks(Math.min(...volumes), Math.max(...volumes), 4) : [0, 1];
  const [low, high] = [grid[0], grid[grid.length - 1]];
  const x = (/** @type {number} */ views) => EDGE.left + (views / most) * (width - EDGE.left - EDGE.right);
  const y = (/** @type {number} */ value) => height - EDGE.bottom - ((value - low) / (high - low)) * (height - EDGE.top - EDGE.bottom);
  const across = { x1: EDGE.left, x2: width - EDGE.right };

  if (interval) {
    const [bottom, top] = [y(interval[0]), y(interval[1])];
    svg.append(element("rect", { class: "interval", x: across.x1, y: top, width: across.x2 - across.x1, height: bottom - top }));
  }
  for (const value of points.length > 0 ? grid : []) {
    svg.append(element("line", { class: "grid", ...across, y1: y(value), y2: y(value) }));
    svg.append(element("text", { class: "tick", x: EDGE.left - 8, y: y(value) + 4, "text-anchor": "end" }, number(value)));
  }
  const floor = height - EDGE.bottom;
  svg.append(element("line", { class: "axis", ...across, y1: floor, y2: floor }));
  for (const views of ticks(0, most, width < 420 ? 4 : 6)) {
    if (views > most || !Number.isInteger(views)) continue;
    svg.append(element("text", { class: "tick", x: x(views), y: floor + 16, "text-anchor": "middle" }, String(views)));
  }
  svg.append(element("text", { class: "name", x: (EDGE.left + width - EDGE.right) / 2, y: height - 3, "text-anchor": "middle" }, found ? "views, spread evenly" : "views"));
  if (points.length > 0) svg.append(element("text", { class: "name", x: 12, y: (EDGE.top + floor) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${(EDGE.top + floor) / 2})` }, "mm³"));

  if (!newest) {
    const middle = { x: (EDGE.left + width - EDGE.right) / 2, y: (EDGE.top + floor) / 2, "text-anchor": "middle" };
    svg.append(element("text", { class: "tick", ...middle }, "The volume comes down view by view."));
  } else {
    const path = points.map((point, index) => `${index ? "L" : "M"}${x(point.views).toFixed(1)} ${y(point.volume_mm3).toFixed(1)}`);
    svg.append(element("path", { class: "curve", d: path.join("") }));
    svg.append(element("circle", { class: "newest", cx: x(newest.views), cy: y(newest.volume_mm3), r: 4.5 }));
    label(svg, x(newest.views), y(newest.volume_mm3) - 10, "end", "hull");
  }
  if (found && finished.estimate !== null && interval) {
    const at = y(finished.estimate);
    svg.append(element("line", { class: "estimate", ...across, y1: at, y2: at }));
    // Below the band, unless it lies on the axis.
    const under = y(interval[0]) + 13;
    label(svg, across.x1 + 6, under < floor - 2 ? under : y(interval[1]) - 5, "start", "the grain itself");
  }
  place.replaceChildren(svg);
}

/**
 * A word beside what it names.
 * @param {Element} svg
 * @param {number} x
 * @param {number} y
 * @param {string} anchor
 * @param {string} text
 */
const label = (svg, x, y, anchor, text) => svg.append(element("text", { class: "name", x, y, "text-anchor": anchor }, text));
