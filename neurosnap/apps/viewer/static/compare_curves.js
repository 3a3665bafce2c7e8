// A number over time in two recordings, one curve over the other.

import uPlot from "./vendor/uplot/uPlot.esm.js";
import { make, number, write } from "./dom.js";
import { palette } from "./palette.js";
import { axes, INKS, line, mark, TITLES } from "./plots.js";

const POINTS = 600;
const AGAIN = 700; // milliseconds until what is not read yet is asked for once more

/** The figure. */
export class CompareCurves {
  /**
   * @param {string[]} columns those there are
   * @param {{fetchSeries: Function, fetchSeriesOf: Function, seek: (tick: number) => void}} on
   */
  constructor(columns, on) {
    this._on = on;
    this._other = null;
    this._frame = null;
    this._which = make(
      "select",
      { ariaLabel: "What is plotted" },
      ...columns.map((column) => make("option", { value: column }, TITLES[column])),
    );
    this._which.addEventListener("change", () => this._load());
    this._now = make("div", { className: "now" });
    this._plot = make("div", { className: "plot" });
    this._values = [make("b", {}, "–"), make("b", {}, "–")];
    this._there = make("span");
    const swatch = (k) => make("i", { className: `swatch ${INKS[k]}` });
    const caption = make(
      "figcaption", {}, this._which, " ",
      swatch(0), "here ", this._values[0], " ", swatch(1), this._there, " ", this._values[1],
    );
    this.home = make("figure", { hidden: true }, caption, this._plot);
    new ResizeObserver(() => this.resize()).observe(this._plot);
  }

  /** Compare with a recording, `{number, name, ticks}`; null: with none. */
  compare(other) {
    this._other = other;
    this.home.hidden = other === null;
    if (other) write(this._there, other.name);
    this._load();
  }

  /** Show which tick one is at. */
  at(frame) {
    this._frame = frame;
    if (!this._drawn) return;
    mark(this._now, this._drawn, frame.tick);
    const at = this._data[0].indexOf(frame.tick);
    this._values.forEach((home, k) => write(home, number(this._data[k + 1][at])));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this._plot;
    if (width === 0 || height === 0) return;
    if (this._drawn) this._drawn.setSize({ width, height });
    else if (this._data) this._draw();
  }

  /** The scheme of colours has changed. */
  recolour() {
    if (this._drawn) this._draw();
  }

  /** Ask for both curves until all of them has been read. */
  async _load() {
    const [other, column] = [this._other, this._which.value];
    const isWanted = () => this._other === other && this._which.value === column;
    for (let done = false; other && !done && isWanted(); ) {
      const last = Math.max(other.ticks, this._frame?.tick ?? 1);
      let pair;
      try {
        pair = await Promise.all([
          this._on.fetchSeries(column, 1, last, POINTS),
          this._on.fetchSeriesOf(other.number, column, 1, last, POINTS),
        ]);
      } catch {
        return; // said where it was asked; the other may lack the column
      }
      if (!isWanted()) return;
      this._data = uPlot.join(pair.map(({ ticks, values }) => [ticks, values]));
      if (this._drawn) this._drawn.setData(this._data);
      else this._draw();
      if (this._frame) this.at(this._frame);
      done = pair.every((one) => one.done);
      if (!done) await new Promise((soon) => setTimeout(soon, AGAIN));
    }
  }

  _draw() {
    const { clientWidth: width, clientHeight: height } = this._plot;
    this._drawn?.destroy();
    this._drawn = null;
    if (width === 0 || height === 0) return; // not seen yet
    const colours = palette();
    const [x, y] = axes(colours);
    const series = ["here", "there"].map((label, k) => ({ ...line(colours, k, label), spanGaps: true }));
    const options = {
      width,
      height,
      scales: { x: { time: false }, y: { range: (_, low, high) => [Math.min(0, low), high || 1] } },
      axes: [x, y],
      series: [{}, ...series],
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, y: false, points: { show: false } },
    };
    this._drawn = new uPlot(options, this._data, this._plot);
    this._drawn.over.append(this._now);
    this._drawn.over.addEventListener("click", (event) =>
      this._on.seek(Math.round(this._drawn.posToVal(event.offsetX, "x"))),
    );
    if (this._frame) this.at(this._frame);
  }
}
