/**
 * Whether somebody walks, in words: what the primary makes of the motion, how sure that is, and what it refused.
 *
 * Only a primary that recognises walking says so; of any other there is nothing to show.
 */

import { UNKNOWN, capital, whole } from "./format.js";
import { words } from "./looks.js";

const VERDICTS = {
  walking: "Walking",
  perhaps: "Perhaps walking",
  other: "Moving, not walking",
  rest: "At rest",
};
const REFUSALS = [
  ["rest", "at rest"],
  ["other", "in motion that is not walking"],
  ["perhaps", "too short or too unsure to be a walk"],
];

/** Return `{verdict, word, sure}` of a device: its name for icon and colour, in words, and how likely walking is. */
export function gaitWords({ gait }) {
  if (gait == null || !Object.hasOwn(VERDICTS, gait.verdict)) return { verdict: "unknown", word: UNKNOWN, sure: "" };
  const sure = `Walking is ${likelihood(100 * gait.confidence)}\u00a0% likely`;
  return { verdict: gait.verdict, word: VERDICTS[gait.verdict], sure };
}

/** Nothing is certain: no 0 and no 100. */
function likelihood(share) {
  if (share < 1) return "under 1";
  return share > 99 ? "over 99" : whole(share);
}

/** Return what the primary refused, a sentence for each counter beside it; nothing where none runs. */
export function refusedWords({ primary, counters, refused = {} }) {
  const beside = Object.keys(counters).filter((name) => name !== primary);
  if (!beside.length) return "";
  const told = beside.filter((name) => Object.hasOwn(refused, name)).map((name) => sentence(name, refused[name]));
  return told.join(" ") || "No counter beside it counted steps where nobody walks.";
}

function sentence(name, counts) {
  const parts = REFUSALS.filter(([verdict]) => counts[verdict]).map(([verdict, why]) => `${whole(counts[verdict])} ${why}`);
  const all = REFUSALS.reduce((sum, [verdict]) => sum + counts[verdict], 0);
  return `${capital(words(name))} counted ${whole(all)} more: ${parts.join(", ")}.`;
}
