// @ts-check
// The browser's fold gives what the daemon's gives; src/server/status.rs reads the same file.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";

import { KINDS } from "../stream.js";
import { line } from "../format.js";
import { fold, idle } from "../status.js";

test("the fold is the one in the shared example", async () => {
  const steps = JSON.parse(await readFile(new URL("fold.json", import.meta.url), "utf8"));
  /** @type {import("../status.js").Status} */
  let status = idle();
  // The stream hands on only what the page listens for.
  assert.deepEqual([...new Set(steps.map((/** @type {any} */ step) => step.event.event))].sort(), [...KINDS].sort());
  for (const { event, expect } of steps) {
    assert.notEqual(line(event), event.event, "the log has words for it");
    status = fold(status, event);
    for (const [key, expected] of Object.entries(expect)) {
      assert.deepEqual(status[/** @type {keyof typeof status} */ (key)], expected, `${key} after ${event.event}`);
    }
  }
});
