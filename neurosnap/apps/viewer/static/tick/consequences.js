// What would be believed if a sensor were on, or off: all that its literals imply.

import { few, isComplement, sensorOf } from "../base/literals.js";
import { reachOf } from "../base/reach.js";

const NAMED = 5;

/**
 * Say what a literal implies of other sensors.
 *
 * @param {number} literal
 * @param {object} graph
 * @param {string[]} names
 * @returns {string} such as "on: power; off: door, red"
 */
export function consequences(literal, graph, names) {
  const all = [...reachOf(graph).above([literal]).keys()];
  const others = all.filter((one) => sensorOf(one) !== sensorOf(literal));
  const [off, on] = [true, false].map((isOff) => others.filter((one) => isComplement(one) === isOff));
  const words = [["on", on], ["off", off]].flatMap(([word, some]) => {
    const named = few(some.map((one) => names[sensorOf(one)]), NAMED);
    return some.length ? [`${word}: ${named}`] : [];
  });
  return words.join("; ") || "nothing follows";
}
