// @ts-check
// What happens, as this tab hears of it: by the worker that listens for all tabs of the browser, or by itself.

import { follow } from "./stream.js";

/** @typedef {import("./status.js").RigEvent} RigEvent */
/** @typedef {import("./status.js").Status} Status */
/**
 * @typedef {object} Listener
 * @property {(status: Status, estimated_at_ms: number) => void} snapshot
 * @property {(event: RigEvent) => void} event
 * @property {(kind: import("./stream.js").Connection, heard_ms: number) => void} connection
 */

/**
 * Listens for as long as the page is open.
 * @param {Listener} on
 */
export function watch(on) {
  // Not every browser on a telephone has such workers.
  if (typeof SharedWorker === "undefined") {
    alone(on);
    return;
  }
  const worker = new SharedWorker("/worker.js", { type: "module", name: "grainrig" });
  worker.onerror = () => {
    worker.port.close();
    alone(on);
  };
  worker.port.onmessage = ({ data: { snapshot, event, connection } }) => {
    if (snapshot) on.snapshot(snapshot.status, snapshot.estimated_at_ms);
    if (event) on.event(event);
    if (connection) on.connection(connection.kind, connection.heard_ms);
  };
  addEventListener("pagehide", () => worker.port.postMessage("bye"));
  // A page that is brought back as it was has missed what happened meanwhile.
  addEventListener("pageshow", (event) => event.persisted && location.reload());
}

/**
 * A stream of this tab's own, which it lets go of while nobody sees it: others may need the connection.
 * @param {Listener} on
 */
function alone(on) {
  const stream = follow({ ...on, snapshot: (status) => on.snapshot(status, Date.now()) });
  const follows = () => (document.hidden ? stream.close() : stream.open());
  document.addEventListener("visibilitychange", follows);
  follows();
}
