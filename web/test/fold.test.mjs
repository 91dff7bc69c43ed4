// @ts-check
// The browser's fold gives what the daemon's gives; src/server/status.rs reads the same file.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import test from "node:test";

import { fold, idle } from "../status.js";

test("the fold is the one in the shared example", async () => {
  const steps = JSON.parse(await readFile(new URL("fold.json", import.meta.url), "utf8"));
  /** @type {import("../status.js").Status} */
  let status = idle();
  for (const { event, expect } of steps) {
    status = fold(status, event);
    for (const [key, expected] of Object.entries(expect)) {
      assert.deepEqual(status[/** @type {keyof typeof status} */ (key)], expected, `${key} after ${event.event}`);
    }
  }
});
