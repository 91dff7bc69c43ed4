// @ts-check
import assert from "node:assert/strict";
import test from "node:test";

import { fieldOf } from "../fault.js";
import { judge } from "../verdict.js";

const SOUND = {
  warnings: [],
  hull: { silhouette_iou: { mean: 0.993, min: 0.987 } },
  calibration: { findings: [], views: [{ index: 0, verdict: "good" }] },
  view_details: [{ index: 0, quality: { verdict: "good" } }, { index: 1, quality: null }],
};
const SLIP = "from view 12 on, the grain is 6.0° ± 0.1° behind: it slipped on its pedestal";

test("a result is good where nothing speaks against it", () => {
  assert.deepEqual(judge(SOUND), { grade: "good", reasons: [] });
  assert.equal(judge(null), null);
  assert.equal(judge(undefined), null);
});

test("a warning makes a result doubtful, and is the reason", () => {
  const warnings = ["the hull has 2 more piece(s) than the largest"];
  assert.deepEqual(judge({ ...SOUND, warnings }), { grade: "doubtful", reasons: warnings });
});

test("a slip, a silhouette that is not filled and a bad view make it bad, each said once", () => {
  const slipped = { ...SOUND, warnings: [SLIP], calibration: { findings: [{ text: SLIP }], views: [] } };
  assert.deepEqual(judge(slipped), { grade: "bad", reasons: [SLIP] });
  const untold = judge({ ...slipped, warnings: [] });
  assert.deepEqual(untold, { grade: "bad", reasons: [SLIP] });
  const unfilled = judge({ ...SOUND, hull: { silhouette_iou: { min: 0.928 } } });
  assert.equal(unfilled?.grade, "bad");
  assert.match(unfilled?.reasons.join() ?? "", /0\.928/);
  const views = [{ index: 3, quality: { verdict: "bad" } }, { index: 4, quality: { verdict: "doubtful" } }];
  assert.deepEqual(judge({ ...SOUND, view_details: views }), { grade: "bad", reasons: ["view 3 is bad", "view 4 is doubtful"] });
  const told = judge({ ...SOUND, view_details: views, warnings: ["view 3: focus is 9 px", "view 4: light is 8 %"] });
  assert.deepEqual(told?.reasons.length, 2);
});

test("a refusal finds the field that it names, as a word and the first", () => {
  const form = /** @type {any} */ ({ querySelectorAll: () => ["size_mm", "size_at_contact_mm", "poisson"].map((name) => ({ name })) });
  const named = (/** @type {string} */ text) => /** @type {any} */ (fieldOf(form, new Error(text)))?.name ?? null;
  assert.equal(named("poisson = 0.5: it must be below 0.5; take 0.22"), "poisson");
  assert.equal(named("size_at_contact_mm = 9 mm: it must be less than size_mm"), "size_at_contact_mm");
  assert.equal(named("a compression goes on; wait for its end"), null);
});
