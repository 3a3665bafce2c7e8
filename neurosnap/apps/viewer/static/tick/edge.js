// An edge: the four weights of its square and the threshold, at this tick.
// It holds while the weight that speaks against it stays below the threshold.

import { ask } from "../base/api.js";
import { make, number, table, write } from "../base/dom.js";
import { complementOf, drawn, literalName, testedWords } from "../base/literals.js";
import { term } from "../base/terms.js";

const PATIENCE = 120; // milliseconds a tick has to stay before its weights are asked for

/** What is known of one edge, drawn into an element. */
export class EdgeView {
  constructor(home, names) {
    this._home = home;
    this._names = names;
    this._edge = null;
    this._known = null;
  }

  /** Show an edge, or none. */
  open(edge) {
    clearTimeout(this._timer);
    this._edge = edge;
    this._known = null;
    delete this._home.dataset.tick; // its weights are not here yet
    if (edge === null) return;
    const names = [edge.source, edge.target].map((end) => literalName(this._names, end));
    const backwards = [edge.target, edge.source].map((end) =>
      literalName(this._names, complementOf(end)),
    );
    this._values = Array.from({ length: 5 }, () => make("td", { className: "number" }, "–"));
    this._says = make("p", { className: "quiet" });
    this._tests = make("p", { className: "quiet" });
    const kind = edge.kind === "excite" ? "excites" : "inhibits";
    this._home.replaceChildren(
      make("p", {}, make("b", {}, `${names[0]} → ${names[1]}`), ` ${kind}`),
      make("p", { className: "quiet" }, `the same as ${backwards[0]} → ${backwards[1]}`),
      table("The weights of its square", [], this._lines(edge), { id: "edge" }),
      this._tests,
      this._says,
    );
  }

  /** Show its weights at a tick, once one stays there, and how often it was tested if the order has it. */
  at(tick, playing, graph) {
    clearTimeout(this._timer); // it may have been of another tick
    this._tick = tick;
    if (this._edge === null) return;
    const isThis = ({ source, target }) => source === this._edge.source && target === this._edge.target;
    const found = graph?.edges.find((edge) => isThis(drawn(edge.source, edge.target)));
    write(this._tests, testedWords(found?.tested));
    if (playing || this._known?.tick === tick) return;
    this._timer = setTimeout(() => this._ask(this._edge, tick), PATIENCE);
  }

  async _ask(edge, tick) {
    const { source, target } = edge;
    const isWanted = () => edge === this._edge && tick === this._tick;
    try {
      const known = await ask("edge", { source, target, tick });
      if (isWanted()) this._show(known);
    } catch (error) {
      if (isWanted()) write(this._says, error.message);
    }
  }

  _lines({ source, target }) {
    const both = (end) => [end, complementOf(end)].map((one) => literalName(this._names, one));
    const [[a, a_], [b, b_]] = [both(source), both(target)];
    const pairs = [[a, b], [a, b_], [a_, b], [a_, b_]];
    const labels = pairs.map(([one, other]) => `${one} and ${other}`);
    const limit = make("span", {}, term("threshold"), " of the second");
    return [...labels, limit].map((label, k) => [label, this._values[k]]);
  }

  _show(known) {
    this._known = known;
    known.weights.forEach((weight, k) => write(this._values[k], number(weight)));
    write(this._values[4], number(known.threshold));
    const since = known.since > 0 ? ` since tick ${known.since}` : "";
    write(this._says, `${known.holds ? "It holds" : "It does not hold"}${since}.`);
    this._home.dataset.tick = known.tick;
  }
}
