// The panel of the learned order at a tick: its diagram, focus and description.

import { ask, gathering } from "../base/api.js";
import { counted, find, write } from "../base/dom.js";
import { Diagram } from "./diagram.js";
import { Focus, MOST, Search } from "./focus.js";
import { Orders } from "./orders.js";

const RARELY = 200; // milliseconds between two orders while it plays

/** The panel of the order. */
export class OrderView {
  /**
   * @param {string[]} names
   * @param {import("../run/growth.js").GrowthView} growth
   * @param {object} on
   * @param {(thing: object|null) => void} on.choose told what was clicked
   * @param {(sensor: number) => void} on.goTo
   * @param {(nodes: object[]) => void} on.rename told the names of the sensors in an order
   * @param {() => void} on.change told when another order is shown
   * @param {() => object} on.reasons why each sensor is believed at the tick that is shown
   */
  constructor(names, growth, on) {
    this._on = on;
    this._frame = null;
    this._playing = false;
    this.chosen = null; // `{sensor}`, `{edge}`, or null
    this._sought = null;
    this._arranged = 0; // when an order was last shown
    this.graph = null;
    this.orders = new Orders();
    this.diagram = new Diagram(find("drawing"), {
      pick: on.choose,
      alone: () => this.focus.layOut(true),
      tell: (sensor) => `${names[sensor]}: ${on.reasons().of(sensor)}`,
    });
    this.focus = new Focus(growth, () => this._refocus());
    this._weigh = gathering(async () => {
      const [graph, { tick }] = [this.graph, this._frame];
      if (this.graphOf(this._frame) === null || graph.testedBy === tick) return true;
      const { edges, nodes, done } = await ask("tested", { tick });
      if (!done) return false;
      graph.testedBy = tick;
      graph.edges.forEach((edge, k) => (edge.tested = edges[k]));
      graph.nodes.forEach((node, k) => (node.tested = nodes[k]));
      if (graph !== this.graph) return true;
      this.diagram.weigh(graph);
      this._refocus();
      this._on.change();
      return true;
    });
    this.search = new Search(names, growth, { mark: (found) => this._seek(found), pick: on.goTo });
  }

  /** The order of a frame, if it is the one that is here; null: it is not. */
  graphOf(frame) {
    return this.graph?.id === frame.graph ? this.graph : null;
  }

  /** Show a tick: its order, which while it plays comes now and then, and its state. */
  show(frame, wave, playing) {
    this._frame = frame;
    this._playing = playing;
    this._showOrder();
    this.paint(frame, wave);
    this._describe();
    this.search.show(frame);
  }

  /** Paint what changes without the tick: the wave. */
  paint(frame, wave) {
    this._wave = wave;
    this.diagram.show(this.graph, frame, wave);
    find("drawing").dataset.tick = frame.tick;
  }

  /** Mark what is selected: `{sensor}`, `{edge}`, or null. */
  choose(thing) {
    this.chosen = thing;
    this._refocus();
  }

  _showOrder() {
    const now = performance.now();
    const isDue = !this._playing || now - this._arranged >= RARELY;
    if (isDue) {
      this._arranged = now;
      const graph = this.orders.of(this._frame, (late) => this._showLate(late));
      if (graph) this._setGraph(graph);
    }
    const { graph } = this._frame;
    find("drawing").ariaBusy = this.graph?.id !== graph && graph !== "";
    this._refocus();
    this._on.change();
    if (!this._playing) this._weigh().catch(() => {}); // said where it was asked
  }

  /** An order has come that was not here; it may be of a tick before the one that is shown. */
  _showLate(graph) {
    this._setGraph(graph);
    if (this._playing) this._arranged = performance.now();
    this._showOrder();
    this.paint(this._frame, this._wave);
    this._describe();
  }

  /** Take over an order, the names of the sensors in it, and what is known of how it was tested. */
  _setGraph(graph) {
    const key = ({ sensor, class: of, source, target }) => [sensor, of, source, target].join();
    const all = (order) => [...(order?.edges ?? []), ...(order?.nodes ?? [])];
    const before = new Map(all(this.graph).map((one) => [key(one), one.tested]));
    for (const one of all(graph)) one.tested ??= before.get(key(one));
    this.graph = graph;
    this._on.rename(graph.nodes);
  }

  _seek(found) {
    this._sought = found;
    this._refocus();
  }

  /** Look at what is selected, searched and filtered for. */
  _refocus() {
    if (this.graph === null || this._frame === null) return;
    const focus = this.focus.of(this.graph, this._frame, this.chosen, this._sought);
    this.diagram.focus(focus, this.chosen, this._sought);
    this._describe();
  }

  /** Say what is drawn, for those who do not see it; and why nothing is. */
  _describe() {
    if (this.graph === null) return;
    const { items, sensors } = this.diagram.count;
    const { height, edges, classes } = this.graph;
    const all = this.graph.nodes.length;
    const same = classes.reduce((sum, members) => sum + members.length - 1, 0);
    const counts = [
      counted(all, "sensor"),
      counted(edges.length, "covering edge"),
      counted(same, "equivalence"),
    ];
    const part = items < all ? `, ${items} of them shown` : "";
    const late = find("drawing").ariaBusy === "true" ? `, as of tick ${this.graph.tick}` : "";
    const facts = `${counts.join(", ")}, height ${height}${part}${late}`;
    write(find("diagram-facts"), facts);
    find("drawing").setAttribute("aria-label", `Hasse diagram: ${facts}`);
    find("drawing").dataset.items = items;
    const isTooLarge = sensors > MOST;
    find("drawing-large").hidden = !isTooLarge;
    const why = `${sensors} sensors are too many to be read in a picture. Find a sensor, or choose which to show: up to ${MOST} are drawn.`;
    write(find("drawing-large"), isTooLarge ? why : "");
  }
}
