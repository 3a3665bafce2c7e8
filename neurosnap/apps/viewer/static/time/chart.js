// Curves over ticks: a line at the current tick, values under the pointer, a range to drag.

import { font, make, palette, repainted } from "../base/dom.js";

/** The colours of curves, in their order. */
export const INKS = ["first", "second", "third", "fourth"];
const DASHES = [[], [6, 3], [2, 3], [8, 3, 2, 3]]; // told apart by these, too

const { uPlot } = window; // its file is no module
const DRAGGED = 5; // pixels from where it is no click any more
// What is plotted by ticks is counted: no axis has halves.
const WHOLE = Array.from({ length: 10 }, (_, k) => [1, 2, 5].map((n) => n * 10 ** k)).flat();

const moved = (event) => event === "mousemove"; // of what happens to one chart, others share this

/** A figure's plot. */
export class Chart {
  /**
   * @param {HTMLElement} home it fills this
   * @param {string[]} labels one a curve; all values are whole, from 0 up
   * @param {object} on
   * @param {(tick: number) => void} on.seek told the tick that was clicked
   * @param {(from: number, to: number) => void} on.range told the ticks that were dragged over
   * @param {(tick: number|null, values: (number|null)[]) => void} on.hover told the tick
   *   under the pointer, and the value of each curve that is nearest to it
   */
  constructor(home, labels, on) {
    this._home = home;
    this._labels = labels;
    this._on = on;
    this._now = make("div", { className: "now" });
    this._tick = null;
    this._ends = [1, 0];
    new ResizeObserver(() => this._resize()).observe(home);
    repainted(() => this._draw());
  }

  /**
   * Draw other values.
   *
   * @param {number[][]} data ticks, then the values of each curve
   * @param {[number, number]} ends the first and the last tick of the axis: there may be
   *   more than is known yet
   */
  set(data, [first, last]) {
    this._data = data;
    const more = first === last ? 0.5 : 0; // an axis has a length
    this._ends = [first - more, last + more];
    if (this._drawn) this._drawn.setData(data);
    else this._draw();
  }

  /** Show which tick one is at. */
  at(tick) {
    this._tick = tick;
    this._place();
  }

  _draw() {
    const { clientWidth: width, clientHeight: height } = this._home;
    this._drawn?.destroy();
    this._drawn = null;
    if (!this._data || width === 0 || height === 0) return; // not seen yet
    const colours = palette();
    const grid = {
      stroke: colours.mute,
      font: font(10),
      grid: { stroke: colours.line, width: 1 },
      ticks: { show: false },
    };
    const range = (_, low, high) => [Math.min(0, low), high || 1];
    this._drawn = new uPlot(
      {
        width,
        height,
        scales: { x: { time: false, range: () => this._ends }, y: { range } },
        axes: [
          { ...grid, size: 20, gap: 2, space: 60 },
          { ...grid, size: 42, gap: 3, space: 22, incrs: WHOLE },
        ],
        series: [{}, ...this._labels.map((label, k) => this._curve(label, k, colours))],
        legend: { show: false },
        cursor: this._cursor(),
        hooks: this._hooks(),
      },
      this._data,
      this._home,
    );
    this._drawn.over.append(this._now);
    this._listen(this._drawn.over);
    this._place();
  }

  _curve(label, k, colours) {
    const [ink, dash] = [INKS[k % INKS.length], DASHES[k % DASHES.length]];
    return { label, points: { show: false }, stroke: colours[ink], width: 1.6, dash };
  }

  _cursor() {
    return {
      y: false,
      points: { show: false },
      drag: { x: true, y: false, setScale: false, dist: DRAGGED, click: () => {} },
      bind: { dblclick: () => null }, // a second click is a click
      sync: { key: "plots", setSeries: false, filters: { pub: moved, sub: moved } },
    };
  }

  _hooks() {
    const place = [() => this._place()]; // sizes are known only once it is drawn
    const tickAt = (drawn, x) => Math.round(drawn.posToVal(x, "x"));
    return {
      draw: place,
      setCursor: [
        (drawn) => {
          const { idx, idxs } = drawn.cursor;
          const isNone = idx === null || idx === undefined;
          const values = this._labels.map((_, k) => drawn.data[k + 1][idxs?.[k + 1]] ?? null);
          this._on.hover(isNone ? null : drawn.data[0][idx], values);
        },
      ],
      setSelect: [
        (drawn) => {
          const { left, width } = drawn.select;
          if (width < DRAGGED) return;
          drawn.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          this._on.range(tickAt(drawn, left), tickAt(drawn, left + width));
        },
      ],
    };
  }

  /** A click goes to its tick; the end of a drag is none. */
  _listen(over) {
    let from = 0;
    over.addEventListener("mousedown", ({ clientX }) => (from = clientX));
    over.addEventListener("click", ({ clientX, offsetX }) => {
      if (Math.abs(clientX - from) >= DRAGGED) return;
      this._on.seek(Math.round(this._drawn.posToVal(offsetX, "x")));
    });
  }

  /**
   * Put the line that marks a tick where it belongs. It lies in the plot's own area: asking
   * the browser where that is would cost a layout with every tick.
   */
  _place() {
    const [first, last] = this._ends;
    const isThere = this._drawn && this._tick >= first && this._tick <= last;
    this._now.hidden = !isThere;
    if (!isThere) return;
    this._now.style.transform = `translateX(${this._drawn.valToPos(this._tick, "x")}px)`;
  }

  _resize() {
    const { clientWidth: width, clientHeight: height } = this._home;
    if (width === 0 || height === 0) return;
    if (this._drawn) this._drawn.setSize({ width, height });
    else this._draw();
  }
}
