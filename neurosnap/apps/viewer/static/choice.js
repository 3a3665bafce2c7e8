// What is selected: a sensor with its edges, or an edge with its weights.

import { find, make, write } from "./dom.js";
import { EdgeView } from "./edge.js";
import { bitWord, conditions, drawn, few, literalName, sensorOf } from "./literals.js";

const NAMED = 8; // members of a class that are listed

/** The panel of what is selected. */
export class ChoiceView {
  /**
   * @param {string[]} names
   * @param {{pick: (thing: object|null) => void, fetchEdge: Function}} on
   */
  constructor(names, on) {
    this._names = names;
    this._on = on;
    this._thing = null;
    this._edge = new EdgeView(find("choice-body"), names, on.fetchEdge);
    find("choice-close").addEventListener("click", () => on.pick(null));
  }

  /** Show what is selected: `{sensor}`, `{edge}`, or null. */
  choose(thing, frame, graph) {
    this._thing = thing;
    this._graph = null;
    find("choice").hidden = thing === null;
    this._edge.open(thing?.edge ?? null);
    if (thing?.edge) write(find("choice-title"), "Selected edge");
    if (thing !== null && frame) this.show(frame, graph, false);
  }

  /** Show a tick. */
  show(frame, graph, playing) {
    if (this._thing === null) return;
    if (this._thing.edge) this._edge.at(frame.tick, playing);
    else this._showSensor(this._thing.sensor, frame, graph);
  }

  /** The scheme of colours has changed. */
  recolour() {
    if (this._thing?.edge) this._edge.recolour();
  }

  _showSensor(sensor, frame, graph) {
    if (graph !== this._graph || graph === null) {
      this._graph = graph;
      this._reads = make("dd");
      this._has = make("dd");
      const facts = make(
        "dl",
        {},
        make("dt", {}, "reads"),
        this._reads,
        make("dt", {}, "state"),
        this._has,
        ...(graph ? this._place(sensor, graph) : []),
      );
      find("choice-body").replaceChildren(facts, this._edges(sensor, graph));
      write(find("choice-title"), this._names[sensor]);
    }
    write(this._reads, bitWord(frame.bits[sensor]));
    write(this._has, conditions(frame)[sensor]);
  }

  _place(sensor, graph) {
    const node = graph.nodes[sensor];
    const same = graph.classes.find((members) => members.some((a) => sensorOf(a) === sensor));
    const facts = [make("dt", {}, "layer"), make("dd", {}, String(node.layer))];
    if (same) {
      const members = same.map((literal) => literalName(this._names, literal));
      facts.push(make("dt", {}, "equal"), make("dd", {}, few(members, NAMED, " ≡ ")));
    }
    return facts;
  }

  _edges(sensor, graph) {
    const list = make("ul", { ariaLabel: "Edges" });
    for (const edge of graph?.edges ?? []) {
      const one = drawn(edge.source, edge.target);
      if (sensorOf(one.source) !== sensor && sensorOf(one.target) !== sensor) continue;
      const open = make("button", { type: "button", className: "link" }, this._arrow(one));
      open.addEventListener("click", () => this._on.pick({ edge: one }));
      list.append(make("li", {}, open));
    }
    return list.children.length ? list : make("p", { className: "quiet" }, this._none(sensor, graph));
  }

  /** Why there are no edges: those of a class are drawn at the one that stands for all. */
  _none(sensor, graph) {
    const standing = graph === null ? sensor : sensorOf(graph.nodes[sensor].class);
    return standing === sensor ? "No edges yet." : `Its edges are those of ${this._names[standing]}.`;
  }

  _arrow({ source, target, kind }) {
    const [from, to] = [source, target].map((end) => literalName(this._names, end));
    return `${from} → ${to} (${kind === "excite" ? "excites" : "inhibits"})`;
  }
}
