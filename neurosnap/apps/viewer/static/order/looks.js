// How each item looks at a tick: what the state has of it, how far the wave has come, and
// whether it is selected or found.

import { beliefs, countKinds } from "../tick/belief.js";

/**
 * @typedef {object} Look
 * @property {string} condition on, off, unknown or contradicted; of a summary, none
 * @property {boolean} predicted the state has it, and it was not read
 * @property {number|null} reads what was read of it
 * @property {object|null} counts of a summary: how many of its sensors are what
 * @property {number} touched of a summary: how many of its sensors the wave has reached
 * @property {number} own how the wave stands to the sensor's own literal: 0 has not
 *   reached it, 1 has, 2 has at this very hop
 * @property {number} complement the same for its complement
 * @property {boolean} waving a wave is shown
 * @property {boolean} chosen it is selected
 * @property {boolean} found the search found it
 * @property {boolean} dim there is a search, and it did not find it, or something else is
 *   looked at
 */

/** Something that is the same for looks that are the same. */
export const lookKey = (look) =>
  Object.values({ ...look, counts: Object.values(look.counts ?? {}) }).join();

/**
 * Return what gives each item its look.
 *
 * @param {object} frame
 * @param {{hops: Map<number, number>, at: number}|null} wave
 * @param {{sensor: number}|null} chosen
 * @param {Set<number>|null} sought the sensors a search has found; null: there is none
 * @param {Set<number>|null} seen the sensors that are looked at; null: all
 */
export function looks(frame, wave, chosen, sought, seen = null) {
  const held = beliefs(frame);
  const reached = reach(wave);
  const isElsewhere = (sensors) => seen !== null && !sensors.some((one) => seen.has(one));
  return ({ kind, sensors }) => {
    const single = kind === "sensor";
    const [sensor] = sensors;
    const found = sought !== null && sensors.some((one) => sought.has(one));
    const touched = (one) => reached(2 * one) || reached(2 * one + 1);
    return {
      ...(single ? held[sensor] : SEVERAL),
      counts: single ? null : countKinds(held, sensors),
      touched: single ? 0 : sensors.filter(touched).length,
      own: single ? reached(2 * sensor) : 0,
      complement: single ? reached(2 * sensor + 1) : 0,
      waving: wave !== null,
      chosen: single && chosen?.sensor === sensor,
      found,
      dim: (sought !== null && !found) || isElsewhere(sensors),
    };
  };
}

const SEVERAL = { condition: "", reads: null, predicted: false };

function reach(wave) {
  if (wave === null) return () => 0;
  const now = Math.floor(wave.at);
  return (literal) => {
    const hop = wave.hops.get(literal);
    if (hop === undefined || hop > now) return 0;
    return hop === now ? 2 : 1;
  };
}
