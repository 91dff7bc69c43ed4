// @ts-check
// The event stream, with its reconnection and its pulse; in a worker for all tabs of a browser, or in the page itself.

import { API, ApiError, alive } from "./api.js";

/** @typedef {import("./status.js").RigEvent} RigEvent */
/** @typedef {import("./status.js").Status} Status */
/** @typedef {"live"|"waiting"|"offline"|"locked"} Connection */

/** The kinds of event that the stream names. */
export const KINDS = [
  "started", "homed", "moving", "captured", "rejected", "suspended", "paused", "resumed", "aborted",
  "acquisition_complete", "silhouette", "judged", "hull", "working", "products", "failed", "complete", "compression", "job",
];

/** After so long without a word the daemon is asked whether it is still there. */
const QUIET_MS = 4000;
/** How often that is looked at. */
const PULSE_MS = 2000;

/**
 * Follows the event stream.
 *
 * EventSource comes back by itself after a lost connection, with the number of the last event. It gives up where the
 * daemon answers with an error, and it does not notice a daemon that hangs or a cable that is pulled. So the daemon is
 * asked when nothing was heard for a while, and the stream is opened anew, after that number, once it answers.
 *
 * @param {object} on
 * @param {(status: Status) => void} on.snapshot
 * @param {(event: RigEvent) => void} on.event
 * @param {(kind: Connection, heard_ms: number) => void} on.connection With the time, by this computer's clock, at which
 *   the daemon was last heard; 0 where it never was.
 * @returns {{ open: () => void, close: () => void }} Closes the stream, and opens it again where it is not open.
 */
export function follow(on) {
  /** @type {string|null} */
  let last = null;
  /** @type {EventSource|null} */
  let source = null;
  /** @type {Connection} */
  let kind = "waiting";
  let heard_ms = 0;
  let asking = false;
  let open = false;

  const tell = (/** @type {Connection} */ now) => {
    if (now === kind) return;
    kind = now;
    on.connection(kind, heard_ms);
  };
  const heard = () => {
    heard_ms = Date.now();
    tell("live");
  };
  const drop = () => {
    source?.close();
    source = null;
  };
  const begin = () => {
    const opened = new EventSource(`${API}/events${last === null ? "" : `?after=${last}`}`);
    source = opened;
    opened.onopen = heard;
    opened.addEventListener("snapshot", (message) => {
      last = message.lastEventId;
      heard();
      on.snapshot(JSON.parse(message.data).status);
    });
    for (const kind of KINDS) {
      opened.addEventListener(kind, (message) => {
        last = message.lastEventId;
        heard();
        on.event(JSON.parse(message.data));
      });
    }
    opened.onerror = () => {
      if (source !== opened) return;
      if (kind === "live") tell("waiting");
      if (opened.readyState === EventSource.CLOSED) drop();
      // Opened again at the next beat: a daemon that refuses streams is not to be stormed.
      void pulse(false);
    };
  };

  /**
   * Asks whether the daemon is there, and opens the stream where it is, that is closed, and it may be opened.
   * @param {boolean} may_open
   */
  async function pulse(may_open) {
    if (!open || asking) return;
    asking = true;
    try {
      await alive();
      if (!open) return;
      if (source === null && may_open) begin();
      else if (source?.readyState === EventSource.OPEN) heard();
    } catch (error) {
      if (!open) return;
      // What a stream that hangs still has to say comes again.
      drop();
      const locked = error instanceof ApiError && error.kind === "unauthorised";
      tell(locked ? "locked" : "offline");
      // Somebody has to give the token first.
      if (locked) open = false;
    } finally {
      asking = false;
    }
  }

  setInterval(() => {
    if (source === null || Date.now() - heard_ms >= QUIET_MS) void pulse(true);
  }, PULSE_MS);
  const it = {
    open() {
      if (open) return;
      open = true;
      begin();
    },
    close() {
      open = false;
      drop();
      tell("waiting");
    },
  };
  it.open();
  return it;
}
