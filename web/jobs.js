// @ts-check
// What is computed beside the rig: what waits, what goes on, and what has failed.

import { make, part } from "./dom.js";
import { computing } from "./format.js";
import { isUnderWay } from "./status.js";

/**
 * @param {import("./status.js").Job[]} jobs
 * @param {(path: string, by: { button: string, fault: string }) => Promise<boolean>} want
 */
export function showJobs(jobs, want) {
  // What is done shows among the sessions, and a compression that goes on has a panel of its own.
  const shown = jobs.filter(({ kind, state }) => ["waiting", "failed"].includes(state) || (state === "running" && kind !== "compress"));
  part("jobs-title").hidden = shown.length === 0;
  part("jobs").replaceChildren(
    ...shown.map((job) => {
      const text = make("span", { class: job.state === "failed" ? "run-error" : "hint" }, computing(job));
      if (!isUnderWay(job) || job.state === "running") return make("li", {}, text);
      const id = `cancel-job-${job.job}`;
      const cancel = make("button", { type: "button", class: "quiet", id, "aria-label": `Cancel ${computing(job)}` }, "Cancel");
      cancel.addEventListener("click", () => void want(`/jobs/${job.job}/cancel`, { button: id, fault: "sessions-fault" }));
      return make("li", { class: "unfinished" }, text, cancel);
    }),
  );
}
