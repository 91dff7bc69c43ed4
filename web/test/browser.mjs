// @ts-check
// A real browser and a real daemon on the simulated rig, for the tests that look at the page.
//
// GRAINRIG_BIN     the binary (without it such tests are skipped)
// CHROMIUM         the browser; without it the one that playwright has installed
// GRAINRIG_REQUIRE what may not be lacking: `tools` or `all` make a skipped test a failure
// GRAINRIG_SKIPPED the file to which skipped tests are added
// SCREENSHOT_DIR   where pictures of the page go, if anywhere

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { appendFileSync, existsSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";

const chromium = await import("playwright-core").then((module) => module.chromium, () => null);
const executablePath = process.env.CHROMIUM || chromium?.executablePath();

/** What is lacking for a test in a browser; undefined where nothing is. */
function lacking() {
  if (!process.env.GRAINRIG_BIN) return "GRAINRIG_BIN names no program";
  if (!chromium) return "playwright-core is not installed (npm ci)";
  if (!executablePath || !existsSync(executablePath)) return "no browser is installed (make tools)";
  return undefined;
}

/** Why a test in a browser is skipped; false where it is not. Throws where `GRAINRIG_REQUIRE` asks for what is lacking. */
export function missing() {
  const why = lacking();
  if (why === undefined) return false;
  const list = process.env.GRAINRIG_SKIPPED;
  if (list) appendFileSync(list, `page, tests in a browser: ${why} (tools)\n`);
  const required = (process.env.GRAINRIG_REQUIRE ?? "").split(",");
  if (required.includes("tools") || required.includes("all")) throw new Error(`a test in a browser would be skipped: ${why}`);
  return `skipped: ${why}`;
}

const FLAGS = [
  "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking", "--disable-component-update",
  "--disable-sync",
];
/** As long as a run or a compression may take on a busy computer. */
export const LIMIT_MS = 180_000;

/**
 * Starts the daemon, on a port of its own unless one is given.
 * @param {string} data
 */
async function daemon(data, listen = "127.0.0.1:0") {
  const child = spawn(/** @type {string} */ (process.env.GRAINRIG_BIN), ["serve", "--data", data, "--listen", listen], {
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

/**
 * A page of a daemon of its own, which both go when the test is over.
 * @param {import("node:test").TestContext} t
 */
export async function opened(t) {
  assert.ok(chromium);
  const data = await mkdtemp(join(tmpdir(), "grainrig-monitor-"));
  t.after(() => rm(data, { recursive: true, force: true }));
  let { child, url } = await daemon(data);
  /** Sends the daemon a signal that ends it, and waits for that. */
  const end = async (/** @type {NodeJS.Signals} */ signal) => {
    const ended = new Promise((resolve) => child.once("exit", resolve));
    if (child.exitCode === null && child.signalCode === null && child.kill(signal)) await ended;
  };
  t.after(() => end("SIGTERM"));
  const browser = await chromium.launch({ executablePath, args: FLAGS });
  t.after(() => browser.close());
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 } });
  const page = await context.newPage();
  /** What the page's console complained of. */
  const complaints = /** @type {string[]} */ ([]);
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  page.on("pageerror", (error) => complaints.push(error.message));
  return {
    url,
    page,
    /** Ends the daemon at once, as a power cut does. */
    kill: () => end("SIGKILL"),
    /** Lets it hang, or go on. */
    hang: (/** @type {boolean} */ hangs) => child.kill(hangs ? "SIGSTOP" : "SIGCONT"),
    /** Starts it again at the same address. */
    restart: async () => {
      ({ child } = await daemon(data, new URL(url).host));
    },
    /** Asks the daemon for a run, without the page. */
    run: async (/** @type {string} */ name, settings = {}) => {
      const begun = await page.request.post(new URL("api/v1/runs", url).href, { data: { name, ...settings } });
      assert.equal(begun.status(), 201, await begun.text());
    },
    complaints,
    picture: async (/** @type {string} */ name) => {
      const folder = process.env.SCREENSHOT_DIR;
      if (folder) await page.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
    },
    /** Asserts that nothing is wider than the window. */
    fits: async () => {
      const [wide, there] = await page.evaluate(() => [document.documentElement.scrollWidth, window.innerWidth]);
      assert.ok(wide <= there, `the page is ${wide} px wide, the window ${there} px`);
    },
    says: (/** @type {string} */ id, /** @type {RegExp} */ text, timeout = 15_000) =>
      page.getByTestId(id).filter({ hasText: text }).waitFor({ timeout }),
  };
}
