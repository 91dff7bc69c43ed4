// @ts-check
// One event stream for all tabs of a browser: a browser has six connections to a host, and six streams would take them
// all, so that no tab could ask for anything any more.

import { fold, idle } from "./status.js";
import { follow } from "./stream.js";

/** @type {Set<MessagePort>} */
const tabs = new Set();
let status = idle();
/** When the estimate of the time left was made, by this computer's clock; 0 before there is a status. */
let estimated_at_ms = 0;
/** @type {unknown} The last word on the connection. */
let connection = null;

const tell = (/** @type {unknown} */ message) => tabs.forEach((tab) => tab.postMessage(message));
const snapshot = () => ({ snapshot: { status, estimated_at_ms } });

const stream = follow({
  snapshot(now) {
    status = now;
    estimated_at_ms = Date.now();
    tell(snapshot());
  },
  event(event) {
    status = fold(status, event);
    if (event.event === "captured" || event.event === "resumed") estimated_at_ms = Date.now();
    tell({ event });
  },
  connection(kind, heard_ms) {
    connection = { connection: { kind, heard_ms } };
    tell(connection);
  },
});

/** @type {any} */ (globalThis).onconnect = (/** @type {MessageEvent} */ { ports: [tab] }) => {
  tabs.add(tab);
  // A tab says one thing: that it goes.
  tab.onmessage = () => tabs.delete(tab);
  if (connection !== null) tab.postMessage(connection);
  if (estimated_at_ms > 0) tab.postMessage(snapshot());
  // Locked it waits for a tab that brings the token.
  stream.open();
};
