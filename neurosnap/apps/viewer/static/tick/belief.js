// What a tick's state holds of each sensor against what was read of it. The state follows
// from the readings and the learned order: it may hold what was not read, and holds nothing
// where readings and order contradict each other.

import { unread } from "../run/growth.js";
import { bitWord, conditions, few, literalName, sensorOf } from "../base/literals.js";
import { reachOf } from "../base/reach.js";

const NAMED = 2;

const COUNTED = {
  on: "read on",
  off: "read off",
  predicted: "predicted",
  contradicted: "contradicted",
  unknown: "unknown",
};

/**
 * What there is of each sensor of a frame.
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

/** How many of some sensors are on and off, as read, and predicted, contradicted, unknown. */
export function countKinds(found, sensors) {
  const counts = { on: 0, off: 0, predicted: 0, contradicted: 0, unknown: 0 };
  for (const sensor of sensors) {
    const { condition, predicted } = found[sensor];
    counts[predicted ? "predicted" : condition] += 1;
  }
  return counts;
}

/** The same of all sensors of a frame but those that are not read any more, or not yet. */
export function countAll(frame) {
  // What the decision changed holds from the next tick on.
  const changed = new Map(frame.changed.map(({ sensor, retires }) => [sensor, retires]));
  const found = beliefs(frame);
  const read = [...found.keys()].filter((one) => changed.get(one) ?? !unread(frame, one));
  const counts = countKinds(found, read);
  return { ...counts, on: read.filter((one) => found[one].condition === "on").length };
}

/** Counts in words; what there is none of is left out. */
const countWords = (counts) =>
  Object.entries(COUNTED)
    .filter(([kind]) => counts[kind] > 0)
    .map(([kind, words]) => `${counts[kind]} ${words}`)
    .join(", ");

/** Says of one sensor after the other why it is believed, for one frame. */
export class Reasons {
  /**
   * @param {string[]} names
   * @param {object} frame
   * @param {object|null} graph the order of this frame; null: it is not here
   */
  constructor(names, frame, graph) {
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
    const doubt = [...culprits, ...others].includes(sensor) ? "; but it may be wrong, see the anomaly" : "";
    return this._belief(sensor) + doubt;
  }

  _belief(sensor) {
    const { condition, reads, predicted } = this._found[sensor];
    const read = reads === null ? "not read" : `reads ${bitWord(reads)}`;
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

  /** How many of some sensors are what, in words. */
  count(sensors) {
    return countWords(countKinds(this._found, sensors));
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

/** What to say of an item under the pointer. */
export function tellItem({ kind, name, sensors }, reasons) {
  if (kind !== "sensor") return `${name}: ${reasons.count(sensors)}`;
  return `${name}: ${reasons.of(sensors[0])}`;
}
