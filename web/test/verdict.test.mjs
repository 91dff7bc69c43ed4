// @ts-check
import assert from "node:assert/strict";
import test from "node:test";

import { fieldOf } from "../fault.js";
import { judge } from "../verdict.js";

const SLIP = "from view 12 on, the grain is 6.0° ± 0.1° behind: it slipped on its pedestal";

test("a result's verdict is the one that it states; without one there is none", () => {
  assert.deepEqual(judge({ verdict: { verdict: "good", reasons: [] }, warnings: [] }), { grade: "good", reasons: [], warnings: [] });
  for (const none of [null, undefined, {}, { verdict: null }, { verdict: { verdict: "splendid" } }, { verdict: { verdict: "toString" } }]) {
    assert.equal(judge(none), null);
  }
});

test("reasons come first, and what a reason says no warning says again", () => {
  const pieces = "the hull has 2 more piece(s) than the largest";
  const slipped = { verdict: { verdict: "doubtful", reasons: [SLIP] }, warnings: [pieces, SLIP] };
  assert.deepEqual(judge(slipped), { grade: "doubtful", reasons: [SLIP], warnings: [pieces] });
});

test("a refusal finds the field that it names, as a word and the first", () => {
  const form = /** @type {any} */ ({ querySelectorAll: () => ["size_mm", "size_at_contact_mm", "poisson"].map((name) => ({ name })) });
  const named = (/** @type {string} */ text) => /** @type {any} */ (fieldOf(form, new Error(text)))?.name ?? null;
  assert.equal(named("poisson = 0.5: it must be below 0.5; take 0.22"), "poisson");
  assert.equal(named("size_at_contact_mm = 9 mm: it must be less than size_mm"), "size_at_contact_mm");
  assert.equal(named("a compression goes on; wait for its end"), null);
});
