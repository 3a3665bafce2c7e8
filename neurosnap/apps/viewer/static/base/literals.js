// Literals: sensor s has literal 2s, and its complement, written s*, has 2s + 1.

import { counted } from "./dom.js";

export const sensorOf = (literal) => literal >> 1;
export const complementOf = (literal) => literal ^ 1;
export const isComplement = (literal) => (literal & 1) === 1;

/** What a literal is called. */
export const literalName = (names, literal) =>
  names[sensorOf(literal)] + (isComplement(literal) ? "*" : "");

/**
 * What an edge is drawn as. It and its contrapositive say the same; of the two the one
 * is drawn whose source is no complement, so that what implies stands below.
 */
export function drawn(source, target) {
  const turn = isComplement(source) && isComplement(target);
  const [from, to] = turn ? [complementOf(target), complementOf(source)] : [source, target];
  return { source: from, target: to, kind: isComplement(to) ? "inhibit" : "excite" };
}

/** How often a relation was tested, in words; nothing until that is known. */
export const testedWords = (tested) =>
  tested === undefined ? "" : tested ? `tested on ${counted(tested, "occasion")}` : "not tested yet";

/** Some names, and how many more there are. */
export function few(names, most, between = ", ") {
  const more = names.length - most;
  return names.slice(0, most).join(between) + (more > 0 ? ` and ${more} more` : "");
}

const LONGEST = 28; // characters of a name that are drawn

/** A name as it is drawn: of a very long one the beginning and the end tell it apart. */
export function shortened(name) {
  const letters = [...name];
  if (letters.length <= LONGEST) return name;
  const half = (LONGEST - 1) >> 1;
  return `${letters.slice(0, half).join("")}…${letters.slice(-half).join("")}`;
}

/** The word for a reading, or for what the state has of a sensor. */
export const bitWord = (bit) => (bit === null ? "unknown" : bit ? "on" : "off");

/** What a sensor reads, and the number that it compares: "on (63.2)". */
export function readWord({ bits, numbers }, sensor) {
  return bitWord(bits[sensor]) + (sensor in numbers ? ` (${numbers[sensor]})` : "");
}

/** What the state has of each sensor of a frame: on, off, unknown or contradicted. */
export function conditions(frame) {
  const words = frame.state.map(bitWord);
  for (const sensor of frame.contradicted) words[sensor] = "contradicted";
  return words;
}

// What lies above and below literals in a learned order, over any number of edges. All
// that are equivalent stand for each other: going from one to another is no step.

/** Ways through an order. */
export class Reach {
  /**
   * @param {object} graph as the server gives it
   * @param {(edge: object) => boolean} passes which edges may be gone along
   * @param {boolean} joins whether one may go from a literal to those equivalent to it
   */
  constructor(graph, passes = () => true, joins = true) {
    this._up = new Map(); // what a literal implies at once
    this._same = new Map();
    for (const edge of graph.edges) {
      if (!passes(edge)) continue;
      this._join(edge.source, edge.target);
      this._join(complementOf(edge.target), complementOf(edge.source));
    }
    for (const members of joins ? graph.classes : []) {
      const turned = members.map(complementOf);
      for (const each of members) this._same.set(each, members);
      for (const each of turned) this._same.set(each, turned);
    }
  }

  /**
   * What some literals imply, themselves among it.
   *
   * @param {number[]} literals
   * @param {number} most edges to go along
   * @returns {Map<number, number>} each literal, with the one of those given that is
   *   nearest to it
   */
  above(literals, most = Infinity) {
    const found = new Map();
    let ahead = [];
    const take = (literal, from) => {
      if (found.has(literal)) return;
      found.set(literal, from);
      ahead.push(literal);
    };
    const takeSame = () => {
      for (const one of [...ahead]) {
        for (const same of this._same.get(one) ?? []) take(same, found.get(one));
      }
    };
    for (const literal of literals) take(literal, literal);
    takeSame();
    for (let gone = 0; gone < most && ahead.length > 0; gone += 1) {
      const last = ahead;
      ahead = [];
      for (const one of last) {
        for (const next of this._up.get(one) ?? []) take(next, found.get(one));
      }
      takeSame();
    }
    return found;
  }

  /** What implies some literals, likewise. */
  below(literals, most = Infinity) {
    const turned = this.above(literals.map(complementOf), most);
    return new Map([...turned].map(([one, from]) => [complementOf(one), complementOf(from)]));
  }

  _join(source, target) {
    if (!this._up.has(source)) this._up.set(source, []);
    this._up.get(source).push(target);
  }
}

const whole = new WeakMap(); // by graph: a way through it is found many times

/** The ways through all of an order. */
export function reachOf(graph) {
  if (!whole.has(graph)) whole.set(graph, new Reach(graph));
  return whole.get(graph);
}
