// The card of what is selected: a sensor with its edges, or an edge with its weights.

import { find, link, make, write } from "../base/dom.js";
import { conditions, drawn, few, isComplement, literalName, readWord, sensorOf, testedWords } from "../base/literals.js";
import { term } from "../base/terms.js";
import { unread } from "../run/growth.js";
import { consequences } from "./belief.js";
import { EdgeView } from "./edge.js";

const NAMED = 8; // members of a class that are listed

/** The panel of what is selected. */
export class ChoiceView {
  /** @param {string[]} names @param {{pick: (thing: object|null) => void}} on */
  constructor(names, on) {
    this._names = names;
    this._on = on;
    this._thing = null;
    this._edge = new EdgeView(find("choice-body"), names);
    find("choice-close").addEventListener("click", () => on.pick(null));
  }

  /** Show what is selected: `{sensor}`, `{edge}`, or null. */
  choose(thing, frame, graph, reasons) {
    this._thing = thing;
    this._graph = null;
    find("choice").hidden = thing === null;
    this._edge.open(thing?.edge ?? null);
    if (thing?.edge) write(find("choice-title"), "Selected edge");
    if (thing !== null && frame) this.show(frame, graph, false, reasons);
  }

  /** Show a tick. */
  show(frame, graph, playing, reasons) {
    if (this._thing === null) return;
    if (this._thing.edge) this._edge.at(frame.tick, playing, graph);
    else this._showSensor(this._thing.sensor, frame, graph, reasons);
  }

  _showSensor(sensor, frame, graph, reasons) {
    if (graph !== this._graph || graph === null) {
      this._graph = graph;
      this._reads = make("dd");
      this._has = make("dd");
      this._why = make("dd");
      this._equal = make("p", { className: "quiet" });
      const facts = make(
        "dl",
        {},
        make("dt", {}, term("read", "reads")),
        this._reads,
        make("dt", {}, term("state")),
        this._has,
        make("dt", {}, term("belief")),
        this._why,
        ...(graph ? this._place(sensor, graph) : []),
      );
      find("choice-body").replaceChildren(facts, ...this._edges(sensor, graph));
      write(find("choice-title"), this._names[sensor]);
    }
    const gone = unread(frame, sensor);
    write(this._reads, gone || readWord(frame, sensor));
    write(this._has, gone || conditions(frame)[sensor]);
    write(this._why, reasons.of(sensor));
    write(this._equal, testedWords(this._node(sensor, graph)?.tested));
  }

  /** Names have changed. */
  rename() {
    this._graph = undefined;
  }

  _node(sensor, graph) {
    return graph?.nodes.find((node) => node.sensor === sensor);
  }

  _place(sensor, graph) {
    const node = this._node(sensor, graph);
    if (node === undefined) return [];
    const same = graph.classes.find((members) => members.some((a) => sensorOf(a) === sensor));
    const facts = [make("dt", {}, term("layer")), make("dd", {}, String(node.layer))];
    if (same) {
      const members = same.map((literal) => literalName(this._names, literal));
      facts.push(make("dt", {}, term("equivalence", "equal")), make("dd", {}, few(members, NAMED, " ≡ "), this._equal));
    }
    for (const [literal, word] of [[2 * sensor, "if on"], [2 * sensor + 1, "if off"]]) {
      facts.push(make("dt", {}, term(word)), make("dd", {}, consequences(literal, graph, this._names)));
    }
    return facts;
  }

  _edges(sensor, graph) {
    const list = graph ? edgeList(sensor, graph, this._names, (edge) => this._on.pick({ edge })) : [];
    return list.length ? list : [make("p", { className: "quiet" }, this._none(sensor, graph))];
  }

  /** Why there are no edges: those of a class are drawn at the one that stands for all. */
  _none(sensor, graph) {
    const standing = sensorOf(this._node(sensor, graph)?.class ?? 2 * sensor);
    return standing === sensor ? "No edges yet." : `Its edges are those of ${this._names[standing]}.`;
  }
}

// The edges of a sensor in groups, by what they say of it.

const FEW = 6; // edges of a group that are listed before all are asked for

/** What an edge says of one of its two sensors. */
function groupOf({ source, target }, sensor) {
  if (isComplement(target)) return "excludes";
  if (isComplement(source)) return "one of the two is on";
  return sensorOf(source) === sensor ? "implies" : "implied by";
}

/**
 * List the edges of a sensor.
 *
 * @param {number} sensor
 * @param {object} graph
 * @param {string[]} names
 * @param {(edge: object) => void} pick
 * @returns {HTMLElement[]} a heading and a list for each group there is
 */
function edgeList(sensor, graph, names, pick) {
  const own = graph.edges
    .map(({ source, target }) => drawn(source, target))
    .filter(({ source, target }) => sensorOf(source) === sensor || sensorOf(target) === sensor);
  const groups = Map.groupBy(own, (edge) => groupOf(edge, sensor));
  return [...groups].flatMap(([title, edges]) => group(title, edges, sensor, names, pick));
}

function group(title, edges, sensor, names, pick) {
  const list = make("ul", { className: "edges", ariaLabel: title });
  const add = (some) =>
    list.append(
      ...some.map((edge) => {
        const { source, target } = edge;
        const other = sensorOf(source) === sensor ? target : source;
        const whole = `${literalName(names, source)} → ${literalName(names, target)}`;
        const open = link(names[sensorOf(other)], () => pick(edge));
        open.title = whole;
        return make("li", {}, open);
      }),
    );
  add(edges.slice(0, FEW));
  const heading = make("h3", {}, `${title} `, make("span", { className: "quiet" }, edges.length));
  if (edges.length <= FEW) return [heading, list];
  const showAll = () => {
    more.remove();
    add(edges.slice(FEW));
    list.children[FEW].querySelector("button").focus();
  };
  const more = link(`Show all ${edges.length}`, showAll, "");
  return [heading, list, more];
}
