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
  // What is done shows among the sessions, and a session's compression that goes on has a panel of its own.
  const shown = jobs.filter(({ name, state }) => ["waiting", "failed"].includes(state) || (state === "running" && !name));
  part("jobs-title").hidden = shown.length === 0;
  part("jobs").replaceChildren(
    ...shown.map((job) => {
      const text = make("span", { class: job.state === "failed" ? "run-error" : "hint" }, computing(job));
      // Others end by themselves within minutes, and can't be stopped in their middle.
      const canStop = job.state === "waiting" || job.kind === "compress";
      if (!isUnderWay(job) || !canStop) return make("li", {}, text);
      const id = `cancel-job-${job.job}`;
      const cancel = make("button", { type: "button", class: "quiet", id, "aria-label": `Cancel ${computing(job)}` }, "Cancel");
      cancel.addEventListener("click", () => void want(`/jobs/${job.job}/cancel`, { button: id, fault: "sessions-fault" }));
      return make("li", { class: "unfinished" }, text, cancel);
    }),
  );
}
