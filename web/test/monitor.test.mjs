// @ts-check
// The monitor in a real browser, with a real daemon on the simulated rig; browser.mjs says what that takes.

import assert from "node:assert/strict";
import test from "node:test";

import { LIMIT_MS, missing, opened } from "./browser.mjs";

test("a run is started in the browser and watched to its end", { skip: missing() }, async (t) => {
  const { url, page, complaints, picture, fits, says } = await opened(t);

  await page.goto(url);
  await says("connection", /^Live$/);
  await says("state", /^Ready$/);
  await page.getByLabel("Name of the new run").fill("browser-test");
  await page.getByTestId("start").click();

  // The picture of each view comes as it is captured, before the run is over.
  await says("state", /^Capturing$/, LIMIT_MS);
  await says("step", /^[1-9]\d* of 26$/, LIMIT_MS);
  const frame = page.getByTestId("last-frame");
  await frame.waitFor();
  await says("angle", /^\d+\.\d°$/);
  await says("remaining", /^\d+ s$|min/, LIMIT_MS);
  // The next run's name is not the one that is taken now.
  assert.equal(await page.getByLabel("Name of the new run").inputValue(), "browser-test-2");

  await says("volume", /^\d[\d.,]* mm³$/, LIMIT_MS);
  await page.getByTestId("pause").click();
  await says("state", /^Paused$/);
  await page.setViewportSize({ width: 360, height: 780 });
  await fits();
  await picture("paused-360");
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.getByTestId("resume").click();
  await says("state", /^Capturing$/);
  await says("step", /^([89]|1\d) of 26$/, LIMIT_MS);
  await picture("running-1280");
  await says("state", /^Computing$/, LIMIT_MS);
  await picture("computing-1280");

  await says("state", /^Complete$/, LIMIT_MS);
  await says("frame-name", /^view_025\.jpg$/);
  /** Widths of the picture as it is and as it is shown; what it took to bring it here, bytes. */
  const shown = (/** @type {string} */ part) =>
    page.waitForFunction((part) => {
      const image = /** @type {HTMLImageElement} */ (document.getElementById("frame"));
      if (!image.src.endsWith(part)) return null;
      const timing = performance.getEntriesByName(image.src).at(-1);
      return { width: image.naturalWidth, bytes: /** @type {any} */ (timing)?.encodedBodySize ?? 0 };
    }, part).then((handle) => handle.jsonValue());
  for (const [button, part] of [["Whole picture", "whole"], ["Grain", "grain"]]) {
    await page.getByRole("button", { name: button, exact: true }).click();
    const { width, bytes } = /** @type {any} */ (await shown(part));
    assert.ok(width > 100 && width <= 1280, `the preview of the ${part} is ${width} px wide`);
    assert.ok(bytes > 0 && bytes < 300_000, `the preview of the ${part} has ${bytes} bytes`);
    t.diagnostic(`preview of the ${part}: ${width} px wide, ${bytes} bytes`);
    await picture(`complete-${part}-1280`);
  }
  assert.match((await page.getByTestId("volume").textContent()) ?? "", /^\d[\d.,]* mm³$/);
  assert.match((await page.getByTestId("result").textContent()) ?? "", /Tetrahedra/);
  const [, captured, views] = /^(\d+) of (\d+)$/.exec((await page.getByTestId("step").textContent()) ?? "") ?? [];
  assert.equal(captured, views);
  const products = page.getByTestId("products").getByRole("link");
  assert.ok((await products.count()) >= 4);
  for (const link of await products.all()) {
    const answer = await page.request.head(new URL((await link.getAttribute("href")) ?? "", url).href);
    assert.equal(answer.status(), 200, `${await link.textContent()}`);
  }

  // Opened anew it shows the same, and nothing is wider than a telephone.
  for (const width of [1920, 390, 360]) {
    await page.setViewportSize({ width, height: 844 });
    await page.reload();
    await says("state", /^Complete$/);
    await frame.waitFor();
    await fits();
    await picture(`complete-${width}`);
  }
  await page.emulateMedia({ colorScheme: "dark" });
  await picture("complete-dark-360");
  assert.deepEqual(complaints, []);

  // A name that is taken is said to be, in the page's own words.
  await page.getByLabel("Name of the new run").fill("browser-test");
  await page.getByTestId("start").click();
  await says("start-fault", /another name/);
  const named = await page.getByLabel("Name of the new run").getAttribute("aria-describedby");
  assert.match(named ?? "", /name-help start-fault/);
  await fits();
  await picture("refused-dark-360");
});
