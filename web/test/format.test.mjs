// @ts-check
import assert from "node:assert/strict";
import test from "node:test";

import { ticks } from "../chart.js";
import { duration, headlines, leaves, line, nextName, number } from "../format.js";

test("numbers are read at a glance", () => {
  assert.equal(number(0.523598), "0.5236");
  assert.equal(number(25163), "25,163");
  assert.equal(number(-0.5), "-0.5");
  assert.equal(number(0.0000123), "1.230e-5");
  assert.deepEqual([0, 59.6, 61, 3599, 7260, -5].map(duration), ["0 s", "1 min 00 s", "1 min 01 s", "59 min 59 s", "2 h 01 min", "0 s"]);
});

test("a result's figures get the unit in their name", () => {
  const all = leaves({
    scale_mm_per_px: null,
    hull: { volume_mm3: 0.5, volume_interval_mm3: [0.45, 0.49], volume_unknown: null, bounding_box_mm: { min: [0, 1, 2] } },
    mesh: { nodes: 1200, dihedral_deg: { min: 12.25 } },
    warnings: [],
    view_details: [{ index: 0 }, { index: 1 }],
  });
  const shown = Object.fromEntries(all.map(({ path, label, value }) => [path, `${label}: ${value}`]));
  assert.deepEqual(shown, {
    scale_mm_per_px: "scale: –",
    "hull.volume_mm3": "hull · volume: 0.5000 mm³",
    "hull.volume_interval_mm3": "hull · volume interval: 0.45, 0.49 mm³",
    "hull.volume_unknown": "hull · volume unknown: –",
    "hull.bounding_box_mm.min": "hull · bounding box · min: 0, 1, 2 mm",
    "mesh.nodes": "mesh · nodes: 1,200",
    "mesh.dihedral_deg.min": "mesh · dihedral · min: 12.25°",
    warnings: "warnings: none",
    "view_details.1.index": "view details · 1 · index: 0",
    "view_details.2.index": "view details · 2 · index: 1",
  });
  assert.deepEqual(headlines(all).map(({ label, value }) => `${label} ${value}`), [
    "Volume, least and most 0.45 to 0.49 mm³",
    "Hull’s volume 0.5000 mm³",
    "Nodes 1,200",
    "Smallest dihedral 12.25°",
  ]);
});

test("the next run's name is at hand", () => {
  assert.deepEqual(["quartz", "grain-07", "grain-9", "a-b-99", "grain-20261122-0913"].map(nextName), [
    "quartz-2", "grain-08", "grain-10", "a-b-100", "grain-20261122-0914",
  ]);
  assert.equal(nextName("x".repeat(64)), "x".repeat(64));
});

test("what was wrong with a picture is told in the log", () => {
  const event = (/** @type {Record<string, unknown>} */ what) => line(/** @type {any} */ ({ seq: 1, time: "", view: 3, ...what }));
  const cause = "focus is 9 px, the limit is 5 px";
  assert.equal(event({ event: "rejected", tries: 2, cause }), `View 4, picture 2 is no good: ${cause}`);
  assert.equal(event({ event: "rejected", cause }), `View 4 is no good: ${cause}`);
  assert.equal(event({ event: "suspended", cause }), `Suspended at view 4: ${cause}`);
  assert.equal(event({ event: "judged", verdict: "bad", warnings: ["a", "b"] }), "View 4 does not fit its neighbours: a; b");
});

test("ticks are round and hold the data", () => {
  assert.deepEqual(ticks(0, 26, 6), [0, 5, 10, 15, 20, 25, 30]);
  for (const [low, high] of [[0.51, 0.83], [3, 3], [0, 0], [1e-6, 2e-6], [-1, 1]]) {
    const made = ticks(low, high, 4);
    assert.ok(made[0] <= low && made[made.length - 1] >= high && made.length >= 2 && made.length <= 7, `${made}`);
  }
});
