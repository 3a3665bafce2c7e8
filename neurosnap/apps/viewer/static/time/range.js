// The range of ticks one looks at: playing repeats it, curves and raster show it alone, and
// the address holds it.

import { keepSoon, told } from "../base/address.js";
import { find, write } from "../base/dom.js";

/** The range, null: all ticks. */
export class TickRange {
  /**
   * @param {() => void} change told of every change
   */
  constructor(change) {
    this._change = () => {}; // who is told is not there yet
    this._ends = [1, 0];
    this.chosen = null;
    find("range").addEventListener("click", () => this.set(null));
    this.restore();
    this._change = change;
  }

  /** Between which ticks one can move. */
  setEnds(first, last) {
    this._ends = [first, last];
  }

  /** The first and the last tick to show: of a link they may be of a longer run. */
  get shown() {
    const [first, last] = this._ends;
    return this.chosen?.map((tick) => Math.min(Math.max(tick, first), last)) ?? this._ends;
  }

  /** Choose two ticks, the earlier first, and all between them; null: all there are. */
  set(chosen) {
    this._take(chosen);
    keepSoon({ range: this.chosen && this.chosen.join("-") });
  }

  /** Let it begin (0) or end (1) at a tick; where the other end is passed, that goes. */
  setEnd(which, tick) {
    const ends = [...this.shown];
    ends[which] = tick;
    if (ends[0] > ends[1]) ends[1 - which] = this._ends[1 - which];
    this.set(ends);
  }

  /** Take the range that the address says. */
  restore() {
    const [, from, to] = /^(\d+)-(\d+)$/.exec(told().get("range") ?? "") ?? [];
    this._take(from === undefined || Number(from) > Number(to) ? null : [Number(from), Number(to)]);
  }

  _take(chosen) {
    if (String(chosen) === String(this.chosen)) return;
    this.chosen = chosen;
    for (const id of ["range", "range-compare"]) find(id).hidden = chosen === null;
    write(find("range"), chosen ? `↻ ${chosen[0]} to ${chosen[1]} ×` : "");
    this._change();
  }
}
