// Which part of the order is looked at: what implies the selected sensor and what it implies,
// to some depth; only sensors that are on, contradicted, predicted or grown; only edges of
// some kinds. The rest is faint, or left out where only these are laid out.

import { beliefs } from "../tick/belief.js";
import { find, make, write } from "../base/dom.js";
import { complementOf, drawn, sensorOf } from "../base/literals.js";
import { Reach } from "../base/reach.js";

const EDGES = ["excite", "inhibit", "same"];
const WORDS = { excite: "excites", inhibit: "inhibits", same: "equivalent" };
const ONLY = ["on", "contradicted", "predicted", "grown"];
const DEPTHS = [["1", "1 edge"], ["2", "2 edges"], ["Infinity", "all"]];

/** The controls, and what follows from them. */
export class Focus {
  /** @param {{isGrown: (sensor: number) => boolean, change: () => void}} on */
  constructor(on) {
    this._on = on;
    this._edges = new Set(EDGES);
    this._only = new Set();
    this._alone = false;
    this._reach = null;
    this._depth = find("focus-depth");
    this._depth.append(...DEPTHS.map(([value, text]) => make("option", { value }, text)));
    this._depth.value = "Infinity";
    this._depth.addEventListener("change", () => on.change());
    this._chips = new Map();
    for (const kind of EDGES) this._chip("focus-edges", kind, this._edges);
    for (const kind of ONLY) this._chip("focus-only", kind, this._only);
    find("focus-alone").addEventListener("click", () => this.toggle());
  }

  /** Lay out only what is looked at, or everything. */
  layOut(alone) {
    if (this._alone === alone) return;
    this._alone = alone;
    find("focus-alone").setAttribute("aria-pressed", alone);
    this._on.change();
  }

  toggle() {
    this.layOut(!this._alone);
  }

  /**
   * What is looked at.
   *
   * @returns {{sensors: Set<number>|null, edges: Set<string>, alone: boolean}} the sensors,
   *   null for all of them; which kinds of edges are drawn; whether the rest is left out
   */
  of(graph, frame, chosen) {
    const held = beliefs(frame);
    const is = {
      on: (sensor) => held[sensor].condition === "on",
      contradicted: (sensor) => held[sensor].condition === "contradicted",
      predicted: (sensor) => held[sensor].predicted,
      grown: this._on.isGrown,
    };
    const all = graph.nodes.map(({ sensor }) => sensor);
    this._count(graph, all, is);
    const sensor = chosen?.sensor;
    this._depth.disabled = sensor === undefined;
    let sensors = sensor === undefined ? null : this._around(graph, sensor);
    if (this._only.size > 0) {
      const kept = all.filter((one) => [...this._only].some((kind) => is[kind](one)));
      sensors = new Set(kept.filter((one) => sensors === null || sensors.has(one)));
    }
    find("focus-alone").disabled = sensors === null && !this._alone;
    return { sensors, edges: this._edges, alone: this._alone && sensors !== null };
  }

  /** The sensors of whose literals one implies one of this sensor's, or is implied. */
  _around(graph, sensor) {
    if (this._reach?.graph !== graph) {
      const passes = ({ source, target }) => this._edges.has(drawn(source, target).kind);
      const way = new Reach(graph, passes, this._edges.has("same"));
      this._reach = { graph, way };
    }
    const { way } = this._reach;
    const most = Number(this._depth.value);
    const found = [way.above([2 * sensor], most), way.below([2 * sensor], most)];
    return new Set(found.flatMap((literals) => [...literals.keys()].map(sensorOf)));
  }

  _count(graph, all, is) {
    const kinds = graph.edges.map(({ source, target }) => drawn(source, target).kind);
    for (const kind of EDGES) {
      const same = graph.classes.reduce((sum, { length }) => sum + length - 1, 0);
      const count = kind === "same" ? same : kinds.filter((one) => one === kind).length;
      write(this._chips.get(kind), `${WORDS[kind]} ${count}`);
    }
    for (const kind of ONLY) write(this._chips.get(kind), `${kind} ${all.filter(is[kind]).length}`);
  }

  _chip(home, kind, chosen) {
    const pressed = chosen.has(kind);
    const chip = make("button", { type: "button", className: "chip" }, WORDS[kind] ?? kind);
    chip.setAttribute("aria-pressed", pressed);
    chip.addEventListener("click", () => {
      if (!chosen.delete(kind)) chosen.add(kind);
      chip.setAttribute("aria-pressed", chosen.has(kind));
      this._reach = null;
      this._on.change();
    });
    this._chips.set(kind, chip);
    find(home).append(chip);
  }
}

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
      .map(({ source, target }) => ({ source: stands(source), target: stands(target) }))
      .filter(({ source, target }) => has(source) && has(target)),
    classes: classes.filter(({ length }) => length > 1),
  };
}
