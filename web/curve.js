// @ts-check
// The force on a grain between two plates against how near they have come.

import { EDGE, element, ticks } from "./chart.js";
import { figure, number } from "./format.js";

/**
 * A point of the curve in words: `3.215 N at 4.100 µm`.
 * @param {import("./status.js").CurvePoint} point
 */
export const told = ({ approach_mm, force_n }) => `${figure(force_n)} N at ${figure(1000 * approach_mm)} µm`;

/**
 * Draws the curve into `place`, at its present width.
 * @param {HTMLElement} place
 * @param {import("./status.js").CurvePoint[]} curve
 */
export function drawCurve(place, curve) {
  const width = Math.max(place.clientWidth, 240);
  const height = Math.round(Math.min(Math.max(width * 0.5, 180), 320));
  const newest = curve.at(-1);
  const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img" });
  svg.append(element("title", {}, `Force against the approach of the plates: ${newest ? told(newest) : "nothing yet"}`));
  const microns = curve.map((point) => 1000 * point.approach_mm);
  const across = ticks(Math.min(0, ...microns), Math.max(0.1, ...microns), width < 420 ? 4 : 6);
  const up = ticks(0, Math.max(0.01, ...curve.map((point) => point.force_n)), 4);
  const [left, right] = [across[0], across[across.length - 1]];
  const top = up[up.length - 1];
  const floor = height - EDGE.bottom;
  const x = (/** @type {number} */ value) => EDGE.left + ((value - left) / (right - left)) * (width - EDGE.left - EDGE.right);
  const y = (/** @type {number} */ value) => floor - (value / top) * (floor - EDGE.top);
  const line = { x1: EDGE.left, x2: width - EDGE.right };
  for (const value of up) {
    svg.append(element("line", { class: value === 0 ? "axis" : "grid", ...line, y1: y(value), y2: y(value) }));
    svg.append(element("text", { class: "tick", x: EDGE.left - 8, y: y(value) + 4, "text-anchor": "end" }, number(value)));
  }
  for (const value of across) {
    svg.append(element("text", { class: "tick", x: x(value), y: floor + 16, "text-anchor": "middle" }, number(value)));
  }
  const middle = { x: (EDGE.left + width - EDGE.right) / 2, "text-anchor": "middle" };
  svg.append(element("text", { class: "name", ...middle, y: height - 3 }, "approach of the plates, µm"));
  const half = (EDGE.top + floor) / 2;
  svg.append(element("text", { class: "name", x: 12, y: half, "text-anchor": "middle", transform: `rotate(-90 12 ${half})` }, "N"));
  if (newest) {
    const path = curve.map((point, index) => `${index ? "L" : "M"}${x(1000 * point.approach_mm).toFixed(1)} ${y(Math.max(point.force_n, 0)).toFixed(1)}`);
    svg.append(element("path", { class: "curve", d: path.join("") }));
    svg.append(element("circle", { class: "newest", cx: x(1000 * newest.approach_mm), cy: y(Math.max(newest.force_n, 0)), r: 4.5 }));
  }
  place.replaceChildren(svg);
}
