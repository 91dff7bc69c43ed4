// @ts-check
// The monitor in a real browser, with a real daemon on the simulated rig.
//
// GRAINRIG_BIN     the binary (without it the test is skipped)
// CHROMIUM         the browser; without it the one that playwright has installed
// SCREENSHOT_DIR   where pictures of the page go, if anywhere

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import test from "node:test";

const chromium = await import("playwright-core").then((module) => module.chromium, () => null);
const executablePath = process.env.CHROMIUM || chromium?.executablePath();

/** What is missing for a test in a browser; false where nothing is. */
function missing() {
  if (!process.env.GRAINRIG_BIN) return "skipped: GRAINRIG_BIN names no program";
  if (!chromium) return "skipped: playwright-core is not installed (npm ci)";
  if (!executablePath || !existsSync(executablePath)) return "skipped: no browser is installed (make tools)";
  return false;
}

const FLAGS = [
  "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking", "--disable-component-update",
  "--disable-sync",
];
const RUN_LIMIT_MS = 180_000;

/**
 * Starts the daemon on a port of its own.
 * @param {string} binary
 * @param {string} data
 */
async function daemon(binary, data) {
  const child = spawn(binary, ["serve", "--data", data, "--listen", "127.0.0.1:0"], {
    stdio: ["ignore", "inherit", "pipe"],
  });
  const lines = createInterface({ input: child.stderr });
  const url = await new Promise((resolve, reject) => {
    const heard = /** @type {string[]} */ ([]);
    lines.on("line", (line) => {
      heard.push(line);
      const found = /http:\/\/127\.0\.0\.1:\d+\//.exec(line);
      if (found) resolve(found[0]);
    });
    child.on("error", reject);
    child.on("exit", (code) => reject(new Error(`the daemon ended with ${code}:\n${heard.join("\n")}`)));
  });
  return { child, url: /** @type {string} */ (url) };
}

test("a run is started in the browser and watched to its end", { skip: missing() }, async (t) => {
  assert.ok(chromium);
  const data = await mkdtemp(join(tmpdir(), "grainrig-monitor-"));
  t.after(() => rm(data, { recursive: true, force: true }));
  const { child, url } = await daemon(/** @type {string} */ (process.env.GRAINRIG_BIN), data);
  t.after(async () => {
    const ended = new Promise((resolve) => child.once("exit", resolve));
    if (child.exitCode === null && child.kill("SIGTERM")) await ended;
  });
  const browser = await chromium.launch({ executablePath, args: FLAGS });
  t.after(() => browser.close());
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  const complaints = /** @type {string[]} */ ([]);
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  page.on("pageerror", (error) => complaints.push(error.message));
  const picture = async (/** @type {string} */ name) => {
    const folder = process.env.SCREENSHOT_DIR;
    if (folder) await page.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
  };
  const fits = async () => {
    const [wide, there] = await page.evaluate(() => [document.documentElement.scrollWidth, window.innerWidth]);
    assert.ok(wide <= there, `the page is ${wide} px wide, the window ${there} px`);
  };
  const says = (/** @type {string} */ id, /** @type {RegExp} */ text, timeout = 15_000) =>
    page.getByTestId(id).filter({ hasText: text }).waitFor({ timeout });

  await page.goto(url);
  await says("connection", /^Live$/);
  await says("state", /^Ready$/);
  await page.getByLabel("Name of the new run").fill("browser-test");
  await page.getByTestId("start").click();

  // The picture of each view comes as it is captured, before the run is over.
  await says("state", /^Capturing$/, RUN_LIMIT_MS);
  await says("step", /^[1-9]\d* of 26$/, RUN_LIMIT_MS);
  const frame = page.getByTestId("last-frame");
  await frame.waitFor();
  await says("angle", /^\d+\.\d°$/);
  await says("remaining", /^\d+ s$|min/, RUN_LIMIT_MS);
  // The next run's name is not the one that is taken now.
  assert.equal(await page.getByLabel("Name of the new run").inputValue(), "browser-test-2");

  await says("volume", /^\d[\d.,]* mm³$/, RUN_LIMIT_MS);
  await page.getByTestId("pause").click();
  await says("state", /^Paused$/);
  await page.setViewportSize({ width: 360, height: 780 });
  await fits();
  await picture("paused-360");
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.getByTestId("resume").click();
  await says("state", /^Capturing$/);
  await says("step", /^([89]|1\d) of 26$/, RUN_LIMIT_MS);
  await picture("running-1280");
  await says("state", /^Computing$/, RUN_LIMIT_MS);
  await picture("computing-1280");

  await says("state", /^Complete$/, RUN_LIMIT_MS);
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
  await says("problem", /another name/);
  await fits();
  await picture("refused-dark-360");
});
