// What happens over time: a small plot for each kind of number, all over the same ticks.

import uPlot from "../vendor/uplot/uPlot.esm.js";
import { keepSoon, told } from "../base/address.js";
import { countAll } from "../tick/belief.js";
import { Chart, INKS } from "./chart.js";
import { find, make, number, write } from "../base/dom.js";
import { term } from "../base/terms.js";

const POINTS = 600;
const RARELY = 100; // milliseconds between two readings while it plays: nobody reads faster
const AGAIN = 700; // milliseconds until what is not read yet is asked for once more

// What belongs together is plotted together; the rest by itself.
const PLOTS = [
  ["edges"], ["err"], ["depth", "longest", "height"], ["pulses"],
  ["on", "predicted", "contradicted", "unknown"], ["distance"],
];
/** What the columns are called. */
export const TITLES = {
  edges: "Edges",
  err: "Err",
  depth: "Depth",
  longest: "Longest",
  height: "Height",
  pulses: "Pulses a tick",
  on: "On",
  predicted: "Predicted",
  contradicted: "Contradicted",
  unknown: "Unknown",
  distance: "Distance to target",
};

/** A value of a series, and which tick it is of where that is another. */
export const valueWords = ({ tick, value }, asked) =>
  number(value) + (tick === asked || value === null ? "" : ` at ${tick}`);

/** The panel of plots. */
export class Plots {
  /**
   * @param {HTMLElement} home
   * @param {string[]} columns those there are
   * @param {object} on
   * @param {(column: string, from: number, to: number, points: number) => Promise} on.fetchSeries
   * @param {(tick: number) => void} on.seek
   * @param {(from: number, to: number) => void} on.range
   */
  constructor(home, columns, on) {
    this._on = on;
    this._range = [1, 0];
    this._asking = false;
    this.isReading = true; // not all of it is there yet
    this._frame = null;
    this._told = 0;
    this._under = null; // the tick under the pointer
    this._hidden = new Set(told().get("hide")?.split(","));
    this._plots = PLOTS.map((own) => ({
      columns: own.filter((column) => columns.includes(column)),
    })).filter((plot) => plot.columns.length > 0);
    home.replaceChildren(...this._plots.map((plot) => this._figure(plot)));
    this._offer();
    for (const plot of this._plots) this._hide(plot);
  }

  /** Show ticks `first` to `last`. */
  async load(first, last) {
    this._range = [first, last];
    if (this._asking || last < first) return; // whoever is asking looks at the range again
    this._asking = true;
    this.isReading = true;
    find("plots").ariaBusy = true;
    this._say();
    try {
      while (!(await this._ask())) {
        await new Promise((soon) => setTimeout(soon, AGAIN));
      }
      this.isReading = false;
    } finally {
      this._asking = false;
      find("plots").ariaBusy = false;
      this._say();
    }
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

  /** The scheme of colours has changed. */
  recolour() {
    for (const plot of this._plots) plot.chart.recolour();
  }

  /** What is plotted, a row a tick: of a long run only some. */
  rows() {
    const there = this._plots.filter(({ chart }) => chart.data);
    if (there.length === 0) return [["tick"]];
    const all = uPlot.join(there.map(({ chart }) => chart.data));
    const titles = there.flatMap((plot) => plot.columns);
    return [["tick", ...titles], ...all[0].map((_, at) => all.map((values) => values[at] ?? null))];
  }

  /** Ask for everything once; tell whether all is there now. */
  async _ask() {
    const [first, last] = this._range;
    let done = true;
    for (const plot of this._plots) {
      const series = [];
      for (const column of plot.columns) {
        series.push(await this._on.fetchSeries(column, first, last, POINTS));
      }
      done &&= series.every((one) => one.done);
      plot.chart.set(uPlot.join(series.map(({ ticks, values }) => [ticks, values])), [first, last]);
      this._tell(plot);
    }
    return done && String(this._range) === String([first, last]);
  }

  _figure(plot) {
    const home = make("div", { className: "plot" });
    plot.under = []; // the values under the pointer
    plot.values = plot.columns.map(() => make("b", {}, "–"));
    plot.names = plot.columns.map((column, k) => {
      const swatch = make("i", { className: `swatch ${INKS[k]}` });
      return make("span", {}, swatch, term(column, TITLES[column]), " ", plot.values[k], " ");
    });
    plot.chart = new Chart(
      home,
      { labels: plot.columns, whole: true },
      {
        seek: this._on.seek,
        range: this._on.range,
        hover: (tick, values) => this._hover(plot, tick, values),
        together: "plots",
      },
    );
    plot.figure = make("figure", {}, make("figcaption", {}, ...plot.names), home);
    return plot.figure;
  }

  /** List the curves to choose from; the list goes once one is elsewhere. */
  _offer() {
    const list = find("curves");
    const all = this._plots.flatMap((plot) => plot.columns);
    list.querySelector("div").replaceChildren(...all.map((column) => this._choice(column)));
    list.addEventListener("focusout", ({ relatedTarget: next }) => {
      if (!list.contains(next)) list.open = false;
    });
    list.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !list.open) return;
      event.stopPropagation(); // it means no more than that
      list.open = false;
      list.querySelector("summary").focus();
    });
  }

  /** A box that has a curve drawn, or not. */
  _choice(column) {
    const box = make("input", { type: "checkbox", checked: !this._hidden.has(column) });
    box.addEventListener("change", () => {
      this._hidden[box.checked ? "delete" : "add"](column);
      keepSoon({ hide: [...this._hidden].join(",") || null });
      this._hide(this._plots.find(({ columns }) => columns.includes(column)));
    });
    return make("label", {}, box, " ", TITLES[column]);
  }

  /** Draw those curves of a plot that are wanted; a plot of none goes. */
  _hide({ columns, chart, names, figure }) {
    columns.forEach((column, k) => {
      chart.show(k, !this._hidden.has(column));
      names[k].hidden = this._hidden.has(column);
    });
    const shown = names.filter(({ hidden }) => !hidden).length;
    figure.hidden = shown === 0;
    figure.style.flexGrow = 2 + shown; // room for the names
  }

  /** Say what the columns are under the pointer, or else at this tick. */
  _tell(plot) {
    plot.under.forEach((value, k) => write(plot.values[k], number(value)));
    if (plot.under.length || this._frame === null) return;
    const { tick } = this._frame;
    const own = plot.columns.includes("on") ? countAll(this._frame) : this._frame;
    const drawn = plot.chart.valuesAt(tick); // some are known by their series alone
    plot.columns.forEach((column, k) => {
      const words = column in own ? number(own[column]) : valueWords(drawn[k], tick);
      write(plot.values[k], words);
    });
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
