// An edge: the four weights of its square and the threshold, at this tick and over time.
// It holds while the weight that speaks against it stays below the threshold.

import { make, number, write } from "../base/dom.js";
import { complementOf, literalName } from "../base/literals.js";
import { term } from "../base/terms.js";
import { Chart, INKS } from "../time/chart.js";

const PATIENCE = 120; // milliseconds a tick has to stay before its weights are asked for

/** What is known of one edge, drawn into an element. */
export class EdgeView {
  constructor(home, names, fetchEdge) {
    this._home = home;
    this._names = names;
    this._fetch = fetchEdge;
    this._edge = null;
    this._known = null;
    this._asked = null;
    this._chart = null;
  }

  /** Show an edge, or none. */
  open(edge) {
    this._stop();
    this._chart?.end();
    this._chart = null;
    this._edge = edge;
    this._known = null;
    if (edge === null) return;
    const names = [edge.source, edge.target].map((end) => literalName(this._names, end));
    const backwards = [edge.target, edge.source].map((end) =>
      literalName(this._names, complementOf(end)),
    );
    this._values = [...INKS, "limit"].map(() => make("td", { className: "number" }, "–"));
    this._says = make("p", { className: "quiet" });
    const plot = make("div", { className: "plot", role: "img", ariaLabel: "Weights over time" });
    const kind = edge.kind === "excite" ? "excites" : "inhibits";
    this._home.replaceChildren(
      make("p", {}, make("b", {}, `${names[0]} → ${names[1]}`), ` ${kind}`),
      make("p", { className: "quiet" }, `the same as ${backwards[0]} → ${backwards[1]}`),
      make("table", { id: "edge" }, make("tbody", {}, ...this._lines(edge))),
      this._says,
      plot,
    );
    this._chart = new Chart(plot, { labels: [...INKS, "threshold"], limit: true });
  }

  /** Show its weights at a tick, once one stays there. */
  at(tick, playing) {
    this._stop(); // it may have been of another tick
    if (this._edge === null || playing || this._known?.tick === tick) return;
    this._timer = setTimeout(() => this._ask(tick), PATIENCE);
  }

  /** The scheme of colours has changed. */
  recolour() {
    this._chart?.recolour();
  }

  /** Want no answer any more. */
  _stop() {
    clearTimeout(this._timer);
    this._asked?.abort();
  }

  async _ask(tick) {
    this._asked = new AbortController();
    const { source, target } = this._edge;
    try {
      this._show(await this._fetch(source, target, tick, this._asked.signal));
    } catch (error) {
      if (error.name !== "AbortError") write(this._says, error.message);
    }
  }

  _lines({ source, target }) {
    const both = (end) => [end, complementOf(end)].map((one) => literalName(this._names, one));
    const [[a, a_], [b, b_]] = [both(source), both(target)];
    const pairs = [[a, b], [a, b_], [a_, b], [a_, b_]];
    const labels = pairs.map(([one, other]) => `${one} and ${other}`);
    const limit = make("span", {}, term("threshold"), " of the second");
    return [...labels, limit].map((label, k) =>
      make(
        "tr",
        {},
        make("th", { scope: "row" }, swatch(INKS[k] ?? "limit"), label),
        this._values[k],
      ),
    );
  }

  _show(known) {
    this._known = known;
    known.weights.forEach((weight, k) => write(this._values[k], number(weight)));
    write(this._values[4], number(known.threshold));
    const since = known.since > 0 ? ` since tick ${known.since}` : "";
    write(this._says, `${known.holds ? "It holds" : "It does not hold"}${since}.`);
    this._home.dataset.tick = known.tick;
    const { over, tick } = known;
    const weights = INKS.map((_, k) => over.map((one) => one.weights[k]));
    this._chart.at(tick);
    this._chart.set([over.map((one) => one.tick), ...weights, over.map((one) => one.threshold)]);
  }
}

const swatch = (ink) => make("i", { className: `swatch ${ink}` });
