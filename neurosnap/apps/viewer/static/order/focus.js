// The focus: selects which sensors and edges of the order are shown.
// What implies the selected sensor and what it implies, to some depth; only sensors that are on,
// contradicted, predicted or grown; only edges of some kinds. The rest is faint, or left out.

import { find, make, write } from "../base/dom.js";
import { bitWord, complementOf, drawn, Reach, sensorOf } from "../base/literals.js";
import { beliefs } from "../tick/belief.js";

/** The most sensors that are drawn: more could not be read. */
export const MOST = 160;

const EDGES = ["excite", "inhibit", "same"];
const WORDS = { excite: "excites", inhibit: "inhibits", same: "equivalent" };
const [FEW, BARELY] = [10, "under 10 tests"]; // what rests on fewer is not reported as broken
const ONLY = ["on", "contradicted", "predicted", "grown", BARELY];
const DEPTHS = [["1", "1 edge"], ["2", "2 edges"], ["Infinity", "all"]];

/** The controls, and what follows from them. */
export class Focus {
  /**
   * @param {import("../run/growth.js").GrowthView} growth
   * @param {() => void} change told of every change
   */
  constructor(growth, change) {
    this._growth = growth;
    this._change = change;
    this._edges = new Set(EDGES);
    this._only = new Set();
    this._alone = false;
    this._reach = null;
    this._depth = find("focus-depth");
    this._depth.append(...DEPTHS.map(([value, text]) => make("option", { value }, text)));
    this._depth.value = "Infinity";
    this._depth.addEventListener("change", change);
    this._chips = new Map();
    for (const kind of EDGES) this._chip("focus-edges", kind, this._edges);
    for (const kind of ONLY) this._chip("focus-only", kind, this._only);
  }

  /** Lay out only what is looked at, or everything. */
  layOut(alone) {
    if (this._alone === alone) return;
    this._alone = alone;
    find("focus-alone").setAttribute("aria-pressed", alone);
    this._change();
  }

  toggle() {
    this.layOut(!this._alone);
  }

  /**
   * What is looked at. Of an order too large to be drawn it is laid out by itself, and where
   * nothing is selected it is what a search has found, or else what may be wrong.
   *
   * @returns {{sensors: Set<number>|null, edges: Set<string>, alone: boolean, most: number}} the
   *   sensors, null for all of them; which kinds of edges are drawn; whether the rest is left
   *   out; how often at most an edge was tested that is drawn
   */
  of(graph, frame, chosen, sought) {
    const held = beliefs(frame);
    const barely = barelyTested(graph);
    const is = {
      on: (sensor) => held[sensor].condition === "on",
      contradicted: (sensor) => held[sensor].condition === "contradicted",
      predicted: (sensor) => held[sensor].predicted,
      grown: (sensor) => this._growth.isGrown(sensor),
      [BARELY]: (sensor) => barely.has(sensor),
    };
    const all = graph.nodes.map(({ sensor }) => sensor);
    this._count(graph, all, is);
    const sensor = chosen?.sensor;
    this._depth.disabled = sensor === undefined;
    const isLarge = all.length > MOST;
    const asked = isLarge ? (sought ?? suspects(frame)) : null;
    let sensors = sensor === undefined ? asked : this._around(graph, sensor, isLarge);
    if (this._only.size > 0) {
      const kept = all.filter((one) => [...this._only].some((kind) => is[kind](one)));
      sensors = new Set(kept.filter((one) => sensors === null || sensors.has(one)));
    }
    find("focus-alone").disabled = sensors === null && !this._alone;
    const most = this._only.has(BARELY) ? FEW - 1 : Infinity;
    return { sensors, edges: this._edges, alone: (this._alone || isLarge) && sensors !== null, most };
  }

  /** The sensors of whose literals one implies one of this sensor's, or is implied. */
  _around(graph, sensor, isLarge) {
    if (this._reach?.graph !== graph) {
      const passes = ({ source, target }) => this._edges.has(drawn(source, target).kind);
      const way = new Reach(graph, passes, this._edges.has("same"));
      this._reach = { graph, way };
    }
    const { way } = this._reach;
    const within = (most) => {
      const found = [way.above([2 * sensor], most), way.below([2 * sensor], most)];
      return new Set(found.flatMap((literals) => [...literals.keys()].map(sensorOf)));
    };
    const around = within(Number(this._depth.value));
    if (!isLarge || around.size <= MOST) return around;
    this._depth.value = "1"; // what is drawn is what it says
    return within(1);
  }

  _count(graph, all, is) {
    const kinds = graph.edges.map(({ source, target }) => drawn(source, target).kind);
    for (const kind of EDGES) {
      const same = graph.classes.reduce((sum, { length }) => sum + length - 1, 0);
      const count = kind === "same" ? same : kinds.filter((one) => one === kind).length;
      this._showChip(kind, count, !this._edges.has(kind));
    }
    for (const kind of ONLY) this._showChip(kind, all.filter(is[kind]).length, this._only.has(kind));
  }

  /** Show how many there are; a chip that would change nothing goes. */
  _showChip(kind, count, isUsed) {
    const chip = this._chips.get(kind);
    write(chip, `${WORDS[kind] ?? kind} ${count}`);
    chip.hidden = count === 0 && !isUsed;
  }

  _chip(home, kind, chosen) {
    const pressed = chosen.has(kind);
    const chip = make("button", { type: "button", className: "chip" }, WORDS[kind] ?? kind);
    chip.setAttribute("aria-pressed", pressed);
    chip.addEventListener("click", () => {
      if (!chosen.delete(kind)) chosen.add(kind);
      chip.setAttribute("aria-pressed", chosen.has(kind));
      this._reach = null;
      this._change();
    });
    this._chips.set(kind, chip);
    find(home).append(chip);
  }
}

/** The sensors that may be wrong at a tick, and those of the rule that is broken; null: none. */
const suspects = ({ anomaly: one }) => one && new Set([...one.culprits, ...one.others, ...(one.rule ?? []).map(sensorOf)]);

/** The sensors of which a relation was tested seldom; none as long as that is not known. */
const barelyTested = ({ edges, nodes }) =>
  new Set([...edges, ...nodes].filter(({ tested }) => tested < FEW).flatMap(({ sensor, source, target }) => sensor ?? [source, target].map(sensorOf)));

/** The part of an order that has some sensors and kinds of edges. */
export function restricted(graph, { sensors, edges: kinds }) {
  const has = (literal) => sensors.has(sensorOf(literal));
  const classes = graph.classes.map((members) => members.filter(has));
  // Where what stands for a class is left out, another of its members has its edges.
  const standing = new Map();
  graph.classes.forEach(([first], k) => {
    const other = classes[k][0];
    if (other === undefined) return;
    standing.set(first, other);
    standing.set(complementOf(first), complementOf(other));
  });
  const stands = (literal) => standing.get(literal) ?? literal;
  return {
    ...graph,
    nodes: graph.nodes.filter(({ sensor }) => sensors.has(sensor)),
    edges: graph.edges
      .filter(({ source, target }) => kinds.has(drawn(source, target).kind))
      .map((edge) => ({ ...edge, source: stands(edge.source), target: stands(edge.target) }))
      .filter(({ source, target }) => has(source) && has(target)),
    classes: classes.filter(({ length }) => length > 1),
  };
}

// Finding sensors by name, by what is believed of them, by what they read: all that match
// are marked, and Enter goes from one to the next.

const BELIEVED = ["on", "off", "unknown", "contradicted", "predicted", "grown"];
const READ = ["on", "off", "unknown"];

/** The search field. */
export class Search {
  /**
   * @param {string[]} names
   * @param {import("../run/growth.js").GrowthView} growth
   * @param {object} on
   * @param {(found: Set<number>|null) => void} on.mark
   * @param {(sensor: number) => void} on.pick
   */
  constructor(names, growth, on) {
    this._names = names;
    this._growth = growth;
    this._on = on;
    this._field = find("search-text");
    this._found = [];
    this._next = 0;
    this._field.addEventListener("input", () => this._look());
    this._field.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this._clear();
    });
    find("search").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this._found.length === 0) return;
      this._on.pick(this._found[this._next]);
      this._next = (this._next + 1) % this._found.length;
    });
  }

  /** Go to the field. */
  focus() {
    this._field.focus();
    this._field.select();
  }

  /** A tick is shown: what is found by its state may be other sensors now. */
  show(frame) {
    this._frame = frame;
    if (this._field.value.includes(":")) this._look();
  }

  _look() {
    const text = this._field.value.trim().toLowerCase();
    const names = this._names.map((name) => name.toLowerCase());
    const asked = text.split(/\s+/).filter(Boolean).map((word) => this._asked(word, names));
    const wrong = asked.find((one) => typeof one === "string");
    const matches = (_, sensor) => this._growth.isSensor(sensor) && asked.every((is) => is(sensor));
    const all = names.flatMap((name, sensor) => (!wrong && matches(name, sensor) ? [sensor] : []));
    this._found = text ? all : [];
    // A name that is the whole of what was typed comes first.
    this._found.sort((a, b) => (names[b] === text) - (names[a] === text) || a - b);
    this._next = 0;
    const count = this._found.length;
    write(find("search-found"), wrong ?? (text ? (count ? `${count} found` : "none") : ""));
    this._on.mark(text ? new Set(this._found) : null);
  }

  /** What a word asks of a sensor; a text says what is wrong with it. */
  _asked(word, names) {
    const [, key, value] = /^(is|reads):(.*)$/.exec(word) ?? [];
    if (key === undefined) return (sensor) => names[sensor].includes(word);
    const known = key === "is" ? BELIEVED : READ;
    if (!known.includes(value)) return `${key}: one of ${known.join(", ")}`;
    if (value === "grown") return (sensor) => this._growth.isGrown(sensor);
    const { bits } = this._frame;
    if (key === "reads") return (sensor) => bitWord(bits[sensor]) === value;
    const held = beliefs(this._frame);
    if (value === "predicted") return (sensor) => held[sensor].predicted;
    return (sensor) => held[sensor].condition === value;
  }

  _clear() {
    this._field.value = "";
    this._look();
    this._field.blur();
  }
}
