// @ts-check
// Whether a result can be relied on, and why not.

/** @typedef {{ grade: "good"|"doubtful"|"bad", reasons: string[] }} Grading */

/** The hull of one rigid body that is seen by the right cameras fills its silhouettes better than this, as the daemon has it. */
const LEAST_AGREEMENT = 0.95;

/** Each grade in words and as a mark, so that no colour is needed to tell them apart. */
export const GRADES = /** @type {const} */ ({
  good: { mark: "✓", word: "Good" },
  doubtful: { mark: "!", word: "Doubtful" },
  bad: { mark: "✗", word: "Bad" },
});

/**
 * The verdict on a `result.json`: bad where the grain slipped or turned otherwise than the stage, where a view is bad or
 * the hull does not fill a silhouette; doubtful where anything else is to be known; `null` without a result.
 * @param {any} result
 * @returns {Grading|null}
 */
export function judge(result) {
  if (result === null || typeof result !== "object") return null;
  const reasons = [...(result.warnings ?? [])].map(String);
  const known = (/** @type {string} */ text) => reasons.some((reason) => reason.includes(text));
  const findings = result.calibration?.findings ?? [];
  for (const { text } of findings) if (!known(text)) reasons.unshift(text);
  const agreement = result.hull?.silhouette_iou?.min;
  const disagrees = typeof agreement === "number" && agreement < LEAST_AGREEMENT;
  if (disagrees && !known("fills the silhouette")) {
    reasons.unshift(`the hull fills a silhouette only to ${agreement.toFixed(3)} (${LEAST_AGREEMENT} is usual): check the angles and whether the grain has slipped`);
  }
  const views = [
    ...(result.view_details ?? []).map((/** @type {any} */ view) => ({ index: view.index, verdict: view.quality?.verdict })),
    ...(result.calibration?.views ?? []),
  ];
  const of = (/** @type {string} */ verdict) => [...new Set(views.filter((view) => view.verdict === verdict).map(({ index }) => index))];
  for (const verdict of ["bad", "doubtful"]) {
    const these = of(verdict).filter((index) => !known(`view ${index}:`));
    if (these.length > 0) reasons.push(`view${these.length > 1 ? "s" : ""} ${these.join(", ")} ${these.length > 1 ? "are" : "is"} ${verdict}`);
  }
  const bad = findings.length > 0 || disagrees || of("bad").length > 0;
  return { grade: bad ? "bad" : reasons.length > 0 ? "doubtful" : "good", reasons };
}
