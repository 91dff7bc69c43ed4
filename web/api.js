// @ts-check
// The daemon's API: requests, and the event stream with its reconnection.

/** @typedef {import("./status.js").RigEvent} RigEvent */
/** @typedef {import("./status.js").Status} Status */

const API = "/api/v1";

/** The kinds of event that the stream names. */
export const KINDS = [
  "started", "homed", "moving", "captured", "rejected", "suspended", "paused", "resumed", "aborted",
  "acquisition_complete", "silhouette", "judged", "hull", "working", "products", "failed", "complete", "compression",
];

/** A refusal of the daemon, or no answer from it. */
export class ApiError extends Error {
  /**
   * @param {string} kind
   * @param {string} message
   */
  constructor(kind, message) {
    super(message);
    this.kind = kind;
  }
}

/**
 * @param {string} path
 * @param {RequestInit} [options]
 * @returns {Promise<any>} The answer's JSON; `null` where it has none.
 */
async function ask(path, options) {
  let response;
  try {
    response = await fetch(API + path, { cache: "no-store", ...options });
  } catch {
    throw new ApiError("offline", "The daemon does not answer. Check that it runs and that this computer reaches it.");
  }
  const text = await response.text();
  let answer = null;
  try {
    answer = text === "" ? null : JSON.parse(text);
  } catch {
    throw new ApiError("failed", `The daemon answered ${response.status} with something that is not JSON.`);
  }
  if (!response.ok) {
    const error = answer?.error ?? {};
    throw new ApiError(error.kind ?? "failed", error.message ?? `The daemon answered ${response.status}.`);
  }
  return answer;
}

/** @param {string} path */
export const get = (path) => ask(path);

/**
 * @param {string} path
 * @param {unknown} [body]
 */
export function post(path, body) {
  if (body === undefined) return ask(path, { method: "POST" });
  const headers = { "content-type": "application/json" };
  return ask(path, { method: "POST", headers, body: JSON.stringify(body) });
}

/**
 * @param {string} session
 * @param {"frames"|"products"} folder
 * @param {string} file
 */
export function fileUrl(session, folder, file) {
  return `${API}/sessions/${encodeURIComponent(session)}/${folder}/${encodeURIComponent(file)}`;
}

/**
 * @param {string} session
 * @param {string} file
 * @param {string} part `grain` or `whole`
 */
export function previewUrl(session, file, part) {
  return `${API}/sessions/${encodeURIComponent(session)}/previews/${encodeURIComponent(file)}?part=${part}`;
}

/**
 * @param {string} session
 * @param {string} [name] One of its compressions.
 * @param {string} [file] One of its files.
 * @returns {string} Below the API's own address, but for a file.
 */
export function compressionUrl(session, name, file) {
  const list = `/sessions/${encodeURIComponent(session)}/compressions`;
  if (name === undefined) return list;
  const one = `${list}/${encodeURIComponent(name)}`;
  return file === undefined ? one : `${API}${one}/files/${encodeURIComponent(file)}`;
}

/**
 * Follows the event stream for as long as the page is open.
 *
 * EventSource itself comes back after a lost connection, with the number of the last event. It gives up
 * where the daemon answers with an error or a proxy in between does; then we ask why, and begin anew
 * after that number.
 *
 * @param {object} on
 * @param {(status: Status) => void} on.snapshot
 * @param {(event: RigEvent) => void} on.event
 * @param {(kind: "live"|"waiting"|"offline"|"locked") => void} on.connection
 */
export function follow(on) {
  /** @type {string|null} */
  let last = null;
  let pause_ms = 1000;

  const open = () => {
    const source = new EventSource(API + "/events" + (last === null ? "" : `?after=${last}`));
    source.onopen = () => {
      pause_ms = 1000;
      on.connection("live");
    };
    source.addEventListener("snapshot", (message) => {
      last = message.lastEventId;
      on.snapshot(JSON.parse(message.data).status);
    });
    for (const kind of KINDS) {
      source.addEventListener(kind, (message) => {
        last = message.lastEventId;
        on.event(JSON.parse(message.data));
      });
    }
    source.onerror = async () => {
      if (source.readyState !== EventSource.CLOSED) {
        on.connection("waiting");
        return;
      }
      try {
        await get("/status");
        on.connection("waiting");
      } catch (error) {
        const locked = error instanceof ApiError && error.kind === "unauthorised";
        on.connection(locked ? "locked" : "offline");
        // The form opens the page anew; there is nothing to wait for.
        if (locked) return;
      }
      setTimeout(open, pause_ms);
      pause_ms = Math.min(pause_ms * 2, 15_000);
    };
  };
  open();
}
