// A number over time in two recordings, one curve over the other.

import uPlot from "../vendor/uplot/uPlot.esm.js";
import { Chart, INKS } from "./chart.js";
import { make, number, write } from "../base/dom.js";
import { TITLES, valueWords } from "./plots.js";

const POINTS = 600;
const AGAIN = 700; // milliseconds until what is not read yet is asked for once more

/** The figure. */
export class CompareCurves {
  /**
   * @param {string[]} columns those there are
   * @param {object} on
   * @param {Function} on.fetchSeries
   * @param {Function} on.fetchSeriesOf
   * @param {(tick: number) => void} on.seek
   * @param {(from: number, to: number) => void} on.range
   */
  constructor(columns, on) {
    this._on = on;
    this._other = null;
    this._frame = null;
    this._range = null;
    this._which = make(
      "select",
      { ariaLabel: "What is plotted" },
      ...columns.map((column) => make("option", { value: column }, TITLES[column])),
    );
    this._which.addEventListener("change", () => this._load());
    const plot = make("div", { className: "plot" });
    this._values = [make("b", {}, "–"), make("b", {}, "–")];
    this._there = make("span");
    this._at = make("span");
    const swatch = (k) => make("i", { className: `swatch ${INKS[k]}` });
    const caption = make(
      "figcaption", {}, this._which, " ",
      swatch(0), "here ", this._values[0], " ", swatch(1), this._there, " ", this._values[1], this._at,
    );
    this.home = make("figure", { hidden: true }, caption, plot);
    this._chart = new Chart(
      plot,
      { labels: ["here", "there"], whole: true, gaps: false },
      {
        seek: on.seek,
        range: on.range,
        hover: (tick, values) => this._tell(tick, tick === null ? this._present() : values.map(number)),
      },
    );
  }

  /** Compare with a recording, `{number, name, ticks}`; null: with none. */
  compare(other) {
    this._other = other;
    this.home.hidden = other === null;
    if (other) write(this._there, other.name);
    this._load();
  }

  /** Show some ticks only; null: all of both. */
  load(range) {
    if (String(range) === String(this._range)) return;
    this._range = range;
    this._load();
  }

  /** Show which tick one is at. */
  at(frame) {
    this._frame = frame;
    this._chart.at(frame.tick);
    this._tell(null, this._present());
  }

  /** The scheme of colours has changed. */
  recolour() {
    this._chart.recolour();
  }

  /** The values at the tick that is shown, in words. */
  _present() {
    const tick = this._frame?.tick;
    return this._chart.valuesAt(tick).map((value) => valueWords(value, tick));
  }

  _tell(tick, words) {
    this._values.forEach((home, k) => write(home, words[k]));
    write(this._at, tick === null ? "" : ` at tick ${tick}`);
  }

  /** Ask for both curves until all of them has been read. */
  async _load() {
    const [other, column, range] = [this._other, this._which.value, this._range];
    const isWanted = () =>
      this._other === other && this._which.value === column && this._range === range;
    for (let done = false; other && !done && isWanted(); ) {
      const [first, last] = range ?? [1, Math.max(other.ticks, this._frame?.tick ?? 1)];
      let pair;
      try {
        pair = await Promise.all([
          this._on.fetchSeries(column, first, last, POINTS),
          this._on.fetchSeriesOf(other.number, column, first, last, POINTS),
        ]);
      } catch {
        return; // said where it was asked; the other may lack the column
      }
      if (!isWanted()) return;
      this._chart.set(uPlot.join(pair.map(({ ticks, values }) => [ticks, values])), [first, last]);
      if (this._frame) this.at(this._frame);
      done = pair.every((one) => one.done);
      if (!done) await new Promise((soon) => setTimeout(soon, AGAIN));
    }
  }
}
