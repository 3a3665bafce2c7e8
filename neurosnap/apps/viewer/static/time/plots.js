// Small plots over time, one for each kind of number, all over the same ticks.

import { ask, gathering } from "../base/api.js";
import { find, make, number, write } from "../base/dom.js";
import { term } from "../base/terms.js";
import { countAll } from "../tick/belief.js";
import { Chart, INKS } from "./chart.js";

const { uPlot } = window; // its file is no module
const POINTS = 600;
const RARELY = 100; // milliseconds between two readings while it plays: none can be read faster

// What belongs together is plotted together; the rest by itself.
const PLOTS = [
  ["edges"], ["depth", "longest", "height"], ["pulses"],
  ["on", "predicted", "contradicted", "unknown"],
];
const TITLES = {
  edges: "Edges",
  depth: "Depth",
  longest: "Longest",
  height: "Height",
  pulses: "Pulses a tick",
  on: "On",
  predicted: "Predicted",
  contradicted: "Contradicted",
  unknown: "Unknown",
};

/** The panel of plots. */
export class Plots {
  /**
   * @param {HTMLElement} home
   * @param {object} on
   * @param {(tick: number) => void} on.seek
   * @param {(from: number, to: number) => void} on.range
   */
  constructor(home, on) {
    this._on = on;
    this._range = [1, 0];
    this._gather = gathering(() => this._ask());
    this._frame = null;
    this._told = 0;
    this._under = null; // the tick under the pointer
    this._plots = PLOTS.map((columns) => ({ columns }));
    home.replaceChildren(...this._plots.map((plot) => this._figure(plot)));
  }

  /** Show ticks `first` to `last`. */
  async load(first, last) {
    this._range = [first, last];
    if (last < first) return;
    this._wait(true);
    await this._gather().catch(() => this._wait(false)); // said where it was asked
  }

  /** Show which tick one is at; the values, while it plays, now and then. */
  at(frame, playing) {
    this._frame = frame;
    for (const plot of this._plots) plot.chart.at(frame.tick);
    const now = performance.now();
    if (playing && now - this._told < RARELY) return;
    this._told = now;
    for (const plot of this._plots) this._tell(plot);
  }

  /** Ask for everything once; tell whether all is there now. */
  async _ask() {
    const [from, to] = this._range;
    const { done, columns } = await ask("series", { from, to, points: POINTS });
    for (const plot of this._plots) {
      const series = plot.columns.map((column) => columns[column]);
      plot.chart.set(uPlot.join(series.map(({ ticks, values }) => [ticks, values])), [from, to]);
      this._tell(plot);
    }
    const isAll = done && String(this._range) === String([from, to]);
    this._wait(!isAll);
    return isAll;
  }

  _wait(isReading) {
    find("plots").ariaBusy = isReading;
    this._say();
  }

  _figure(plot) {
    const home = make("div", { className: "plot" });
    plot.under = []; // the values under the pointer
    plot.values = plot.columns.map(() => make("b", {}, "–"));
    const names = plot.columns.map((column, k) => {
      const swatch = make("i", { className: `swatch ${INKS[k]}` });
      return make("span", {}, swatch, term(column, TITLES[column]), " ", plot.values[k], " ");
    });
    plot.chart = new Chart(home, plot.columns, {
      seek: this._on.seek,
      range: this._on.range,
      hover: (tick, values) => this._hover(plot, tick, values),
    });
    const figure = make("figure", {}, make("figcaption", {}, ...names), home);
    figure.style.flexGrow = 2 + names.length; // room for the names
    return figure;
  }

  /** Say what the columns are under the pointer, or else at this tick. */
  _tell(plot) {
    plot.under.forEach((value, k) => write(plot.values[k], number(value)));
    if (plot.under.length || this._frame === null) return;
    const own = plot.columns.includes("on") ? countAll(this._frame) : this._frame;
    plot.columns.forEach((column, k) => write(plot.values[k], number(own[column])));
  }

  /** Say which tick is under the pointer, or that more is to come. */
  _say() {
    const more = find("plots").ariaBusy === "true" ? "still being read" : "";
    write(find("plots-at"), this._under === null ? more : `under the pointer: tick ${this._under}`);
  }

  /** Say what the columns are under the pointer; null: it is elsewhere. */
  _hover(plot, tick, values) {
    this._under = tick;
    this._say();
    plot.under = tick === null ? [] : values;
    this._tell(plot);
  }
}
