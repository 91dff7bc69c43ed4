// @ts-check
// The pictures of the book that need a browser: the monitor, and a meshed grain cut open. `docs/pictures.sh` runs this.
//
//   node docs/pictures.mjs DATA DECK OUT
//
// DATA is a data folder, into which a session of the simulated rig is captured while the page is looked at. DECK is a mesh
// as `grain.inp`. The pictures go to the folder OUT. GRAINRIG is the program, CHROMIUM the browser (else playwright's own).

import { spawn } from "node:child_process";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { join } from "node:path";
import { createInterface } from "node:readline";

// The tests of the monitor have installed it (`make tools`).
const { chromium } = createRequire(new URL("../web/package.json", import.meta.url))("playwright-core");
const [data, deck, out] = process.argv.slice(2);
const GRAIN = "quartz-07";
const LIMIT_MS = 600_000;

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM || chromium.executablePath(),
  args: ["--no-sandbox", "--disable-gpu"],
});
try {
  await monitor(join(out, "monitor.jpg"));
  await mesh(join(out, "mesh.png"));
} finally {
  await browser.close();
}

/**
 * The monitor in the midst of a run: started in the page, as a person does.
 * @param {string} file
 */
async function monitor(file) {
  const program = process.env.GRAINRIG ?? "target/release/grainrig";
  const daemon = spawn(program, ["serve", "--data", data, "--listen", "127.0.0.1:0"], {
    stdio: ["ignore", "ignore", "pipe"],
  });
  try {
    const url = await new Promise((resolve, reject) => {
      createInterface({ input: daemon.stderr }).on("line", (line) => {
        const found = /http:\/\/127\.0\.0\.1:\d+\//.exec(line);
        if (found) resolve(found[0]);
      });
      daemon.on("exit", (code) => reject(new Error(`the daemon ended with ${code}`)));
    });
    const page = await browser.newPage({ viewport: { width: 1280, height: 940 } });
    await page.goto(url);
    await page.getByLabel("Name of the new run").fill(GRAIN);
    await page.getByTestId("start").click();
    await page.getByTestId("step").filter({ hasText: /^1[6-9] of 26$/ }).waitFor({ timeout: LIMIT_MS });
    await page.screenshot({ path: file, quality: 85 });
    // Nothing is left half done in the data folder.
    await page.getByTestId("state").filter({ hasText: /^Complete$/ }).waitFor({ timeout: LIMIT_MS });
    await page.close();
  } finally {
    daemon.kill("SIGTERM");
  }
}

/**
 * A grain's tetrahedra, those in front of an upright plane through its middle taken away: its surface and its inside.
 * @param {string} file
 */
async function mesh(file) {
  const { nodes, tets } = read(await readFile(deck, "utf8"));
  const page = await browser.newPage({ viewport: { width: 600, height: 560 } });
  await page.setContent('<style>body{margin:0}</style><canvas id="c" width="600" height="560"></canvas>');
  await page.evaluate(draw, { nodes, tets });
  await page.screenshot({ path: file });
  await page.close();
}

/**
 * Nodes and four-node tetrahedra (from 0) of an Abaqus deck.
 * @param {string} text
 */
function read(text) {
  const nodes = /** @type {number[][]} */ ([]);
  const tets = /** @type {number[][]} */ ([]);
  let block = "";
  for (const line of text.split("\n")) {
    if (line.startsWith("**")) continue;
    if (line.startsWith("*")) block = line.split(",")[0].toUpperCase();
    else if (block === "*NODE") nodes.push(line.split(",").slice(1).map(Number));
    else if (block === "*ELEMENT") tets.push(line.split(",").slice(1).map((n) => Number(n) - 1));
  }
  return { nodes, tets };
}

/**
 * Runs in the page: every face with nothing in front of it, from the farthest to the nearest (the painter's algorithm).
 * @param {{ nodes: number[][], tets: number[][] }} body
 */
function draw({ nodes, tets }) {
  const canvas = /** @type {HTMLCanvasElement} */ (document.getElementById("c"));
  const paper = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  paper.fillStyle = "#ffffff";
  paper.fillRect(0, 0, canvas.width, canvas.height);

  const low = [0, 1, 2].map((k) => nodes.reduce((least, n) => Math.min(least, n[k]), Infinity));
  const high = [0, 1, 2].map((k) => nodes.reduce((most, n) => Math.max(most, n[k]), -Infinity));
  const middle = low.map((l, k) => (l + high[k]) / 2);
  // Turned about the upright axis, then looked down upon a little.
  const [turn, down] = [-0.5, 0.35];
  const seen = nodes.map((n) => {
    const [x, y, z] = n.map((v, k) => v - middle[k]);
    const u = x * Math.cos(turn) - y * Math.sin(turn);
    const w = x * Math.sin(turn) + y * Math.cos(turn);
    // To the right, up, and away from whoever looks.
    return [u, z * Math.cos(down) + w * Math.sin(down), w * Math.cos(down) - z * Math.sin(down)];
  });

  // The half behind the plane stays, and a quarter of the one before it.
  const kept = tets.filter((t) => {
    const [x, y] = [0, 1].map((k) => t.reduce((sum, n) => sum + nodes[n][k], 0) / 4 - middle[k]);
    return y > 0 || x < 0;
  });
  /** The faces of a tetrahedron, counter-clockwise seen from outside. */
  const FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
  const count = (/** @type {number[][]} */ some) => {
    const faces = new Map();
    for (const t of some) {
      for (const f of FACES) {
        const corners = f.map((k) => t[k]);
        const key = [...corners].sort((a, b) => a - b).join();
        faces.set(key, faces.has(key) ? null : corners);
      }
    }
    return faces;
  };
  const surface = count(tets);
  const scale = 0.88 * Math.min(canvas.width / (high[0] - low[0]), canvas.height / (high[2] - low[2])) * 0.92;
  const light = [-0.45, 0.65, -0.6];
  const shown = [];
  for (const [key, corners] of count(kept)) {
    if (!corners) continue;
    const [a, b, c] = corners.map((/** @type {number} */ n) => seen[n]);
    const [p, q] = [b, c].map((r) => r.map((v, k) => v - a[k]));
    const normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    const length = Math.hypot(...normal);
    // `away` makes the frame left-handed, so the outward normal is the negative one.
    const [nx, ny, nz] = normal.map((v) => -v / length);
    if (nz > 0) continue;
    const lit = Math.max(0, nx * light[0] + ny * light[1] + nz * light[2]);
    shown.push({ at: [a, b, c], depth: (a[2] + b[2] + c[2]) / 3, lit, inside: !surface.get(key) });
  }
  shown.sort((one, other) => other.depth - one.depth);
  paper.lineJoin = "round";
  paper.lineWidth = 0.6;
  for (const { at, lit, inside } of shown) {
    const grey = 0.5 + 0.5 * lit;
    const [r, g, b] = (inside ? [122, 170, 214] : [222, 200, 160]).map((v) => Math.round(v * grey));
    paper.fillStyle = `rgb(${r} ${g} ${b})`;
    paper.strokeStyle = "rgb(40 40 40 / 0.55)";
    paper.beginPath();
    at.forEach(([u, v], k) => {
      const place = [canvas.width / 2 + scale * u, canvas.height / 2 - scale * v];
      if (k === 0) paper.moveTo(place[0], place[1]);
      else paper.lineTo(place[0], place[1]);
    });
    paper.closePath();
    paper.fill();
    paper.stroke();
  }
}
