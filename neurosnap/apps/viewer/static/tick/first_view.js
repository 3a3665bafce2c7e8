// What a page begins with where no link says it: a wave that goes deep, if the run has one
// near its end.

import { deepest } from "./wave_advice.js";

const LOOKED_AT = 60; // ticks at the end
const DEEP = 3; // hops

/**
 * Find it.
 *
 * @param {{first: number, ticks: number}} run
 * @param {(from: number, to: number) => Promise<object[]>} fetchFrames
 * @returns {Promise<number|null>} the tick, null: there is none
 */
export async function deepTick({ first, ticks }, fetchFrames) {
  const frames = await fetchFrames(Math.max(first, ticks - LOOKED_AT + 1), ticks);
  let [best, tick] = [DEEP - 1, null];
  for (const frame of frames) {
    const depth = deepest(frame.waves)?.depth ?? 0;
    if (depth > best) [best, tick] = [depth, frame.tick];
  }
  return tick;
}
