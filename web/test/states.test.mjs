// @ts-check
// What the page says when things go otherwise than they should, on a real daemon; browser.mjs says what that takes.

import assert from "node:assert/strict";
import test from "node:test";

import { LIMIT_MS, missing, opened } from "./browser.mjs";

/** A run that takes a second. */
const SMALL = {
  simulated: { width: 648, height: 432, mm_per_px: 0.006 },
  optics: { mm_per_px: 0.006 },
  plan: { views: 5, steps_per_view: 40, settle_ms: 0 },
  mesh: { surface_size_mm: 0.12 },
};
/** One that lets a person do something meanwhile. */
const LONG = { ...SMALL, plan: { views: 10, steps_per_view: 20, settle_ms: 1000 } };
/** As many views as usual: fewer do not tell a slip. */
const WHOLE = { ...SMALL, plan: { views: 25, steps_per_view: 8, settle_ms: 0 } };

test("a run that ends with a slip does not end green, and the newest grain is the one to be pressed", { skip: missing() }, async (t) => {
  const { url, page, complaints, picture, fits, says, run } = await opened(t);
  await page.goto(url);
  await says("connection", /^Live$/);
  const faults = { slip: { at: 12, deg: 6 } };
  await run("slipped", { ...WHOLE, simulated: { ...SMALL.simulated, faults } });
  await says("state", /^Complete$/, LIMIT_MS);
  await says("verdict", /! Doubtful: \d+ reason/);
  await says("verdict", /slipped/);
  const [state, good] = await page.evaluate(() => {
    const probe = document.body.appendChild(document.createElement("i"));
    probe.style.color = "var(--good)";
    const colours = [/** @type {HTMLElement} */ (document.getElementById("state")), probe].map((one) => getComputedStyle(one).color);
    probe.remove();
    return colours;
  });
  assert.notEqual(state, good);
  assert.match(await page.title(), /doubtful/);
  for (const width of [1280, 360]) {
    await page.setViewportSize({ width, height: 900 });
    await fits();
    await picture(`complete-slipped-${width}`);
  }
  await page.setViewportSize({ width: 1280, height: 900 });

  // The grain that was finished last is offered, until a person chooses another.
  const offered = page.getByTestId("press-session");
  const offers = (/** @type {string} */ name) =>
    page.waitForFunction((name) => /** @type {HTMLSelectElement} */ (document.getElementById("press-session")).value === name, name, { timeout: LIMIT_MS });
  await offers("slipped");
  await run("second", SMALL);
  await offers("second");
  await offered.selectOption("slipped");
  await run("third", SMALL);
  await page.waitForFunction(() => [...document.querySelectorAll("#press-session option")].some((one) => one.textContent === "third"), null, { timeout: LIMIT_MS });
  assert.equal(await offered.inputValue(), "slipped");
  assert.deepEqual(complaints, []);
});

test("a refused picture is shown with its cause", { skip: missing() }, async (t) => {
  const { url, page, complaints, picture, fits, says, run } = await opened(t);
  await page.goto(url);
  await says("connection", /^Live$/);
  const faults = { blurred_frame_at: 2, frame_faults_stay: true };
  await run("blurred", { ...SMALL, simulated: { ...SMALL.simulated, faults } });
  await says("state", /^Paused$/, LIMIT_MS);
  await says("rejected-cause", /^focus .*is [\d.]+ px, the limit is [\d.]+ px; \S/);
  await page.waitForFunction(() => /** @type {HTMLImageElement} */ (document.getElementById("rejected-picture")).naturalWidth === 648);
  await picture("suspended-1280");
  await page.setViewportSize({ width: 360, height: 780 });
  await fits();
  await picture("suspended-360");
  // Opened anew it is still there.
  await page.reload();
  await page.waitForFunction(() => /** @type {HTMLImageElement} */ (document.getElementById("rejected-picture")).naturalWidth === 648);
  await page.getByTestId("abort").click();
  await page.getByTestId("abort-sure").click();
  await says("state", /^Aborted$/);
  assert.deepEqual(complaints, []);
});

test("a session that was aborted or interrupted goes on from the page, after a restart too", { skip: missing() }, async (t) => {
  const { url, page, picture, says, run, kill, restart } = await opened(t);
  await page.goto(url);
  await says("connection", /^Live$/);
  await run("broken", LONG);
  await says("step", /^[2-4] of 11$/, LIMIT_MS);
  // By the keyboard alone: the dialog opens with the choice that does nothing.
  await page.getByTestId("abort").focus();
  await page.keyboard.press("Enter");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await says("state", /^Aborted$/);
  await picture("aborted-1280");
  await page.getByTestId("resume").click();
  await says("state", /^Capturing$/, LIMIT_MS);
  await says("step", /^[5-9] of 11$/, LIMIT_MS);

  // A power cut: the page greys, what was is dated, and nothing is counted down.
  await kill();
  await says("connection", /last heard \d\d:\d\d:\d\d$/, LIMIT_MS);
  assert.ok(await page.evaluate(() => document.body.classList.contains("stale")));
  assert.equal(await page.getByTestId("abort").isDisabled(), true);
  await picture("dead-1280");
  await restart();
  await says("connection", /^Live$/, LIMIT_MS);
  await says("state", /^Ready$/, LIMIT_MS);
  assert.equal(await page.evaluate(() => document.body.classList.contains("stale")), false);
  await page.getByRole("button", { name: "Resume broken" }).click();
  await says("state", /^Complete$/, LIMIT_MS);
  await says("step", /^11 of 11$/);
  await says("frame-name", /^view_010\.jpg$/);
});

test("while the daemon hangs the time left stands still", { skip: missing() }, async (t) => {
  const { url, page, says, run, hang } = await opened(t);
  await page.clock.install();
  await page.goto(url);
  await says("connection", /^Live$/);
  await run("hanging", { ...LONG, plan: { ...LONG.plan, settle_ms: 5000 } });
  await says("remaining", /min|\d s/, LIMIT_MS);
  const left = async () => (await page.getByTestId("remaining").textContent()) ?? "";
  const live = await left();
  await page.clock.fastForward(3000);
  await page.waitForFunction((before) => document.getElementById("remaining")?.textContent !== before, live);
  hang(true);
  t.after(() => hang(false));
  await says("connection", /^No connection, last heard/, LIMIT_MS);
  const stale = await left();
  await page.clock.fastForward(60_000);
  assert.equal(await left(), stale);
  // What is asked of it fails within a limit, and says so where it was asked for: nothing can be asked now.
  assert.equal(await page.getByTestId("pause").isDisabled(), true);
  hang(false);
  await says("connection", /^Live$/, LIMIT_MS);
});

test("with ten tabs open Abort works, in any of them", { skip: missing() }, async (t) => {
  const { url, page, says, run } = await opened(t);
  const tabs = [page];
  while (tabs.length < 10) tabs.push(await page.context().newPage());
  await Promise.all(tabs.map((tab) => tab.goto(url)));
  await Promise.all(tabs.map((tab) => tab.getByTestId("connection").filter({ hasText: /^Live$/ }).waitFor()));
  for (const [n, tab] of [tabs[9], tabs[0]].entries()) {
    await run(`run-${n}`, LONG);
    await Promise.all(tabs.map((tab) => tab.getByTestId("step").filter({ hasText: /^[1-9] of 11$/ }).waitFor({ timeout: LIMIT_MS })));
    await tab.bringToFront();
    await tab.getByTestId("abort").click();
    const from = performance.now();
    const [answer] = await Promise.all([
      tab.waitForResponse((response) => response.url().endsWith("/abort"), { timeout: 10_000 }),
      tab.getByTestId("abort-sure").click(),
    ]);
    assert.equal(answer.status(), 204);
    t.diagnostic(`answered after ${Math.round(performance.now() - from)} ms`);
    await tab.getByTestId("state").filter({ hasText: /^Aborted$/ }).waitFor();
    t.diagnostic(`aborted after ${Math.round(performance.now() - from)} ms`);
  }
  await says("state", /^Aborted$/);
});
