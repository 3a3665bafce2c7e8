// What happens over time: a small plot for each kind of number, all on one axis of ticks.

import uPlot from "./vendor/uplot/uPlot.esm.js";
import { make, number, write } from "./dom.js";
import { font, palette } from "./palette.js";
import { term } from "./terms.js";

const POINTS = 600;
const AGAIN = 700; // milliseconds until what is not read yet is asked for once more

// What belongs together is plotted together; the rest by itself.
const PLOTS = [["edges"], ["err"], ["depth", "height"], ["pulses"], ["distance"]];
/** What the columns are called. */
export const TITLES = {
  edges: "Edges",
  err: "Err",
  depth: "Depth",
  height: "Height",
  pulses: "Pulses a tick",
  distance: "Distance to target",
};
// What is plotted is counted: no axis has halves.
const WHOLE = Array.from({ length: 10 }, (_, k) => [1, 2, 5].map((n) => n * 10 ** k)).flat();
/** The colours of series, in their order. */
export const INKS = ["first", "second", "third", "fourth"];

/** One axis pair in the colours of the page. */
export function axes(colours) {
  const look = {
    stroke: colours.mute,
    font: font(10),
    grid: { stroke: colours.line, width: 1 },
    ticks: { show: false },
  };
  return [
    { ...look, size: 20, gap: 2, space: 60 },
    { ...look, size: 42, gap: 3, space: 22 },
  ];
}

/** The line style of the n-th series: told apart by dashes, too. */
export function line(colours, n, label) {
  const ink = INKS[n % INKS.length];
  return {
    label,
    stroke: colours[ink],
    width: 1.6,
    dash: [[], [6, 3], [2, 3], [8, 3, 2, 3]][n % 4],
    points: { show: false },
    spanGaps: false,
  };
}

/**
 * Put the line that marks a tick where it belongs. It lies in the plot's own area: asking
 * the browser where that is would cost a layout with every tick.
 */
export function mark(now, drawn, tick) {
  now.style.transform = `translateX(${drawn.valToPos(tick, "x")}px)`;
}

/** The panel of plots. */
export class Plots {
  /**
   * @param {HTMLElement} home
   * @param {string[]} columns those there are
   * @param {(column: string, from: number, to: number, points: number) => Promise} fetchSeries
   * @param {(tick: number) => void} seek called with the tick that was clicked
   */
  constructor(home, columns, fetchSeries, seek) {
    this._fetch = fetchSeries;
    this._seek = seek;
    this._range = [1, 0];
    this._asking = false;
    this._frame = null;
    this._plots = PLOTS.map((own) => ({
      columns: own.filter((column) => columns.includes(column)),
    })).filter((plot) => plot.columns.length > 0);
    home.replaceChildren(...this._plots.map((plot) => this._figure(plot)));
    new ResizeObserver(() => this._resize()).observe(home);
  }

  /** Show ticks `first` to `last`. */
  async load(first, last) {
    this._range = [first, last];
    if (this._asking || last < first) return; // whoever is asking looks at the range again
    this._asking = true;
    try {
      while (!(await this._ask())) {
        await new Promise((soon) => setTimeout(soon, AGAIN));
      }
    } finally {
      this._asking = false;
    }
  }

  /** Show which tick one is at. */
  at(frame) {
    this._frame = frame;
    for (const plot of this._plots) {
      this._place(plot);
      this._tell(plot);
    }
  }

  /** The scheme of colours has changed. */
  recolour() {
    for (const plot of this._plots) if (plot.data) this._draw(plot);
  }

  /** What is plotted, a row a tick: of a long run only some. */
  rows() {
    const there = this._plots.filter((plot) => plot.data);
    const all = uPlot.join(there.map((plot) => plot.data));
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
        series.push(await this._fetch(column, first, last, POINTS));
      }
      plot.data = uPlot.join(series.map(({ ticks, values }) => [ticks, values]));
      done &&= series.every((one) => one.done);
      if (plot.drawn) plot.drawn.setData(plot.data);
      else this._draw(plot);
      this._tell(plot);
    }
    return done && last === this._range[1];
  }

  _figure(plot) {
    plot.home = make("div", { className: "plot" });
    plot.now = make("div", { className: "now" });
    plot.values = plot.columns.map(() => make("b", {}, "–"));
    const caption = make("figcaption");
    plot.columns.forEach((column, k) => {
      const swatch = make("i", { className: `swatch ${INKS[k]}` });
      caption.append(swatch, term(column, TITLES[column]), " ", plot.values[k], " ");
    });
    return make("figure", {}, caption, plot.home);
  }

  _draw(plot) {
    const colours = palette();
    const [x, y] = axes(colours);
    plot.drawn?.destroy();
    const options = {
      width: Math.max(plot.home.clientWidth, 60),
      height: Math.max(plot.home.clientHeight, 40),
      scales: { x: { time: false }, y: { range: (_, low, high) => [Math.min(0, low), high || 1] } },
      axes: [x, { ...y, incrs: WHOLE }],
      series: [{}, ...plot.columns.map((column, k) => line(colours, k, column))],
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, y: false, points: { show: false } },
      hooks: { draw: [() => this._place(plot)] }, // sizes are known only then
    };
    plot.drawn = new uPlot(options, plot.data, plot.home);
    plot.drawn.over.addEventListener("click", (event) =>
      this._seek(Math.round(plot.drawn.posToVal(event.offsetX, "x"))),
    );
    plot.drawn.over.append(plot.now);
  }

  _place(plot) {
    if (!plot.drawn || plot.data[0].length === 0 || this._frame === null) return;
    mark(plot.now, plot.drawn, this._frame.tick);
  }

  /** Say what the columns are at this tick; some are known by their series alone. */
  _tell(plot) {
    if (this._frame === null) return;
    // A long series is thinned out: what stands beside this tick would be another's.
    const at = plot.data?.[0].indexOf(this._frame.tick);
    plot.columns.forEach((column, k) => {
      const value = this._frame[column] ?? plot.data?.[k + 1][at];
      write(plot.values[k], number(value));
    });
  }

  _resize() {
    for (const plot of this._plots) {
      const { clientWidth: width, clientHeight: height } = plot.home;
      if (!plot.drawn || width === 0) continue;
      plot.drawn.setSize({ width, height });
    }
  }
}
