// @ts-check
// A grain is compressed from the page, on a real daemon; browser.mjs says what that takes.

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

test("a grain is compressed from the page and its curve and stresses are shown", { skip: missing() }, async (t) => {
  const { url, page, complaints, picture, fits, says } = await opened(t);
  await page.goto(url);
  await says("state", /^Ready$/);
  // Without a grain there is nothing to compress.
  await page.getByText("The grain of a complete session can be pressed").waitFor();
  assert.equal(await page.getByTestId("press-start").isVisible(), false);
  const begun = await page.request.post(new URL("api/v1/runs", url).href, { data: { name: "quartz-07", ...SMALL } });
  assert.equal(begun.status(), 201);
  await says("state", /^Complete$/, LIMIT_MS);

  // The form's own figures are what the daemon takes where nothing is said.
  const start = page.getByTestId("press-start");
  await start.waitFor();
  assert.equal(await page.getByTestId("press-session").inputValue(), "quartz-07");
  assert.equal(await page.getByLabel("Yield stress, MPa").isDisabled(), true);
  const usual = await page.evaluate(() => Object.fromEntries(new FormData(/** @type {HTMLFormElement} */ (document.getElementById("press-form")))));
  const document = await (await page.request.get(new URL("api/v1/openapi.json", url).href)).json();
  const known = document.components.schemas.CompressRequest.properties;
  for (const name of Object.keys(usual)) assert.ok(name in known, `the daemon knows ${name}`);
  await picture("compress-form-1280");

  // What cannot be meant is said in the daemon's words, and nothing begins.
  await page.getByLabel("Poisson’s ratio").fill("0.5");
  await start.click();
  await says("press-fault", /poisson/);
  const fault = await page.evaluate(() => {
    const [field, told] = ["press-poisson", "press-fault"].map((id) => /** @type {HTMLElement} */ (document.getElementById(id)));
    const box = told.getBoundingClientRect();
    return {
      described: field.getAttribute("aria-describedby"),
      invalid: field.getAttribute("aria-invalid"),
      focused: document.activeElement === field,
      below: box.top - field.getBoundingClientRect().bottom,
      inSight: box.top >= 0 && box.bottom <= window.innerHeight,
    };
  });
  assert.deepEqual({ ...fault, below: fault.below >= 0 && fault.below < 40 }, { described: "press-fault", invalid: "true", focused: true, below: true, inSight: true }, `${fault.below} px below`);
  await picture("refused-setting-1280");
  await page.getByLabel("Poisson’s ratio").fill("0.22");
  // The refusal is in the console; nothing else may be.
  assert.equal(complaints.splice(0).length, 1);

  // A long one: watched, cancelled, and left to go on.
  await page.getByText("More settings").click();
  await page.getByLabel("Surface size, mm").fill("0.08");
  await page.getByLabel("Size at the contacts, mm").fill("0.05");
  await page.getByLabel("To a force of, N").fill("200");
  await start.click();
  await says("press-name", /^quartz-07, elastic$/, LIMIT_MS);
  await says("press-force", /^[\d.]+ N$/, LIMIT_MS);
  await says("press-left", /s$|min/, LIMIT_MS);
  assert.equal(await start.isDisabled(), true);
  // The curve grows while it is looked at.
  const points = () => page.locator("#press-chart path.curve").getAttribute("d").then((d) => (d ?? "").split(/[ML]/).length);
  const before = await points();
  await page.waitForFunction((n) => (document.querySelector("#press-chart path.curve")?.getAttribute("d") ?? "").split(/[ML]/).length > n, before, { timeout: LIMIT_MS });
  await picture("compress-running-1280");
  await page.setViewportSize({ width: 360, height: 780 });
  await fits();
  const cut = await page.evaluate(() => {
    // As long as it gets within an hour, whatever this computer makes of it.
    document.querySelector("#press-left").textContent = "59 min 59 s";
    return [...document.querySelectorAll(".press .facts dd")].filter((dd) => dd.scrollWidth > dd.clientWidth).map((dd) => dd.textContent);
  });
  assert.deepEqual(cut, [], "no figure runs into the next");
  await picture("compress-running-360");
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.getByTestId("press-cancel").click();
  await says("press-state", /^Cancelled$/, LIMIT_MS);
  assert.equal(await page.getByTestId("press-resume").isDisabled(), false);
  await page.getByTestId("press-resume").click();
  await says("press-state", /^Pressing$/, LIMIT_MS);
  assert.ok((await points()) >= before, "it goes on where it was");
  await page.getByTestId("press-cancel").click();
  await says("press-state", /^Cancelled$/, LIMIT_MS);

  // A short one, plastic, to its end.
  await page.getByLabel("Material").selectOption("plastic");
  await page.getByLabel("Yield stress, MPa").fill("300");
  await page.getByLabel("Surface size, mm").fill("0.15");
  await page.getByLabel("Size at the contacts, mm").fill("0.08");
  await page.getByLabel("To a force of, N").fill("4");
  await start.click();
  await says("press-name", /^quartz-07, plastic$/, LIMIT_MS);
  await says("press-state", /^Complete$/, LIMIT_MS);
  await says("press-results", /Last force/);
  const loaded = (/** @type {string} */ selector) =>
    page.waitForFunction((selector) => {
      const all = [.../** @type {NodeListOf<HTMLImageElement>} */ (document.querySelectorAll(selector))];
      all.forEach((image) => image.scrollIntoView());
      return all.length > 0 && all.every((image) => image.complete && image.naturalWidth > 100) ? all.length : 0;
    }, selector).then((handle) => handle.jsonValue());
  assert.equal(await loaded("#press-sheet img"), 1);
  assert.equal(await loaded("#press-cuts img"), 8);
  for (const link of await page.getByTestId("press-files").getByRole("link").all()) {
    const answer = await page.request.head(new URL((await link.getAttribute("href")) ?? "", url).href);
    assert.equal(answer.status(), 200, `${await link.textContent()}`);
  }
  await page.evaluate(() => window.scrollTo(0, 0));
  await picture("compress-complete-1280");

  // Both are in the list, and the earlier one can be looked at again.
  await page.getByTestId("press-list").getByRole("button", { name: "elastic, interrupted" }).click();
  await says("press-name", /^quartz-07, elastic$/);
  await page.getByTestId("press-list").getByRole("button", { name: "plastic, complete" }).click();
  await says("press-name", /^quartz-07, plastic$/);

  // Opened anew it shows the same, and nothing is wider than a telephone.
  for (const width of [1920, 360]) {
    await page.setViewportSize({ width, height: 844 });
    await page.reload();
    await says("press-state", /^Complete$/);
    assert.equal(await loaded("#press-cuts img"), 8);
    await page.evaluate(() => window.scrollTo(0, 0));
    await fits();
    await picture(`compress-complete-${width}`);
  }
  await page.emulateMedia({ colorScheme: "dark" });
  await picture("compress-complete-dark-360");
  assert.deepEqual(complaints, []);
});
