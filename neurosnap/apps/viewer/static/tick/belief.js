// Compares the state of each sensor at a tick with its reading.
// The state follows from the readings and the learned order: it may hold what was not read, and
// holds nothing where readings and order contradict each other.

import { bitWord, conditions, few, isComplement, literalName, reachOf, readWord, sensorOf } from "../base/literals.js";
import { unread } from "../run/growth.js";

const NAMED = 2;

/**
 * What each sensor of a frame reads, and what is believed of it.
 *
 * @returns {{condition: string, reads: number|null, predicted: boolean}[]} the condition is
 *   on, off, contradicted or unknown; it is predicted where the state has it and it was
 *   not read
 */
export function beliefs(frame) {
  return conditions(frame).map((condition, sensor) => {
    const reads = frame.bits[sensor];
    const isHeld = condition === "on" || condition === "off";
    return { condition, reads, predicted: isHeld && reads === null };
  });
}

/** How many sensors of a frame are what, but for those that are not read any more, or not yet. */
export function countAll(frame) {
  // What the decision changed holds from the next tick on.
  const changed = new Map(frame.changed.map(({ sensor, retires }) => [sensor, retires]));
  const counts = { on: 0, predicted: 0, contradicted: 0, unknown: 0 };
  beliefs(frame).forEach(({ condition, predicted }, sensor) => {
    if (!(changed.get(sensor) ?? !unread(frame, sensor))) return;
    if (condition !== "off") counts[condition] += 1;
    if (predicted) counts.predicted += 1;
  });
  return counts;
}

/** Says of one sensor after the other why it is believed, for one frame. */
export class Reasons {
  /**
   * @param {string[]} names
   * @param {object} frame
   * @param {object|null} graph the order of this frame; null: it is not here
   * @param {object} growth says what is believed though nothing reads it
   */
  constructor(names, frame, graph, growth) {
    this._growth = growth;
    this._names = names;
    this._frame = frame;
    this._found = beliefs(frame);
    this.graph = graph;
  }

  /** What is read and what is believed of a sensor, such as "reads off; door says on". */
  of(sensor) {
    const gone = unread(this._frame, sensor);
    if (gone) return gone;
    const { culprits = [], others = [] } = this._frame.anomaly ?? {};
    const doubt = [...culprits, ...others].includes(sensor) ? "; but it may be wrong, see the findings" : "";
    return this._belief(sensor) + doubt;
  }

  _belief(sensor) {
    const { condition, reads, predicted } = this._found[sensor];
    const carried = this._growth.believed(sensor);
    if (carried) return `never read, believed ${condition}: ${carried}`;
    const read = reads === null ? "not read" : `reads ${readWord(this._frame, sensor)}`;
    if (condition === "contradicted") return [read, ...this._against(sensor, reads)].join("; ");
    if (predicted) {
      const by = this._who(2 * sensor + (condition === "off" ? 1 : 0));
      return by ? `not read; ${by} ${condition}` : `not read; predicted ${condition}`;
    }
    return condition === "unknown" ? `${read}; nothing says more` : `${read}, and believed`;
  }

  /** In a word: read, predicted, contradicted or unknown. */
  kind(sensor) {
    const gone = unread(this._frame, sensor);
    const { condition, predicted } = this._found[sensor];
    if (gone) return gone;
    if (condition === "contradicted" || condition === "unknown") return condition;
    return predicted ? "predicted" : "read";
  }

  /** Who says what else than was read. */
  _against(sensor, reads) {
    const both = [2 * sensor, 2 * sensor + 1];
    return both.flatMap((literal, off) => {
      if (reads === 1 - off) return []; // this is what was read
      const by = this._who(literal);
      return by ? [`${by} ${off ? "off" : "on"}`] : [];
    });
  }

  /** Whose readings imply a literal, the nearest first: "door says"; empty: not known. */
  _who(literal) {
    if (this.graph === null) return "";
    const { bits } = this._frame;
    const isRead = (one) => bits[sensorOf(one)] === 1 - (one & 1);
    const below = [...reachOf(this.graph).below([literal]).keys()];
    const saying = below.filter((one) => sensorOf(one) !== sensorOf(literal) && isRead(one));
    if (saying.length === 0) return "";
    const names = few(saying.map((one) => literalName(this._names, one)), NAMED, ", ");
    return `${names} ${saying.length === 1 ? "says" : "say"}`;
  }
}

// What would be believed if a sensor were on, or off: all that its literals imply.

const FOLLOWING = 5; // sensors that are named

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
    const named = few(some.map((one) => names[sensorOf(one)]), FOLLOWING);
    return some.length ? [`${word}: ${named}`] : [];
  });
  return words.join("; ") || "nothing follows";
}
