// @ts-check
// The daemon's API: requests, each with a time limit, and addresses.

export const API = "/api/v1";

/** As long as an answer may take, ms; one that waits for the rig to open may take longer. */
const LIMIT_MS = 10_000;
const RIG_LIMIT_MS = 60_000;
/** As long as a daemon that is alive may take to say so. */
const ALIVE_MS = 4000;

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
 * @param {number} [limit_ms]
 * @returns {Promise<any>} The answer's JSON; `null` where it has none.
 */
async function ask(path, options, limit_ms = LIMIT_MS) {
  let response;
  let text;
  try {
    response = await fetch(API + path, { cache: "no-store", signal: AbortSignal.timeout(limit_ms), ...options });
    text = await response.text();
  } catch (error) {
    const late = error instanceof DOMException && error.name === "TimeoutError";
    throw new ApiError("offline", late
      ? `The daemon did not answer within ${limit_ms / 1000} s. What was asked may still be done: look at the run’s state before asking again.`
      : "The daemon does not answer. Check that it runs and that this computer reaches it.");
  }
  let answer = null;
  try {
    answer = text === "" ? null : JSON.parse(text);
  } catch {
    throw new ApiError("failed", `The daemon answered ${response.status} with something that is not JSON.`);
  }
  if (!response.ok) {
    const error = answer?.error ?? {};
    // An answer without a body has only its number.
    const kind = error.kind ?? (response.status === 401 ? "unauthorised" : "failed");
    throw new ApiError(kind, error.message ?? `The daemon answered ${response.status}.`);
  }
  return answer;
}

/** @param {string} path */
export const get = (path) => ask(path);

/** Whether the daemon is there: throws where it is not. */
export const alive = () => ask("/status", { method: "HEAD" }, ALIVE_MS);

/**
 * @param {string} path
 * @param {unknown} [body]
 */
export function post(path, body) {
  const limit_ms = path === "/runs" || path.startsWith("/sessions/") ? RIG_LIMIT_MS : LIMIT_MS;
  if (body === undefined) return ask(path, { method: "POST" }, limit_ms);
  const headers = { "content-type": "application/json" };
  return ask(path, { method: "POST", headers, body: JSON.stringify(body) }, limit_ms);
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
 * The last refused picture of a view.
 * @param {string} session
 * @param {number} view
 * @param {number} tries Tells this one from the one before.
 */
export function rejectedUrl(session, view, tries) {
  return `${API}/sessions/${encodeURIComponent(session)}/rejected/${view}?picture=${tries}`;
}

/** @param {string} session */
export const resumeUrl = (session) => `/sessions/${encodeURIComponent(session)}/resume`;

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
