// @ts-check
// Whether a result can be relied on, and why not.

/** @typedef {{ grade: "good"|"doubtful"|"bad", reasons: string[], warnings: string[] }} Grading */

/** Each grade in words and as a mark, so that no colour is needed to tell them apart. */
export const GRADES = /** @type {const} */ ({
  good: { mark: "✓", word: "Good" },
  doubtful: { mark: "!", word: "Doubtful" },
  bad: { mark: "✗", word: "Bad" },
});

/**
 * The verdict that a `result.json` states, with the reasons for it, and the warnings that none of them repeats; `null` without a
 * result, or where an earlier version made it.
 * @param {any} result
 * @returns {Grading|null}
 */
export function judge(result) {
  const grade = result?.verdict?.verdict;
  if (!Object.hasOwn(GRADES, grade ?? "")) return null;
  const reasons = [...(result.verdict.reasons ?? [])].map(String);
  const warnings = [...(result.warnings ?? [])].map(String).filter((warning) => !reasons.includes(warning));
  return { grade, reasons, warnings };
}
