// Depth against height of all waves of a run: a dot for each pair, by kind of wave.
// Words, colours and marks are those of depth.png.

import { ask, gathering } from "../base/api.js";
import { counted, find, shape, write } from "../base/dom.js";

const [LEFT, BOTTOM, SIDE] = [22, 136, 130]; // pixels: the axes, as the page has them
const [LEAST, MOST] = [2, 9]; // half of a dot
const WAYS = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 };

/** The dots beside the wave. */
export class DepthView {
  /** @param {(dot: {tick: number, wave: number}) => void} play told the first wave of a dot */
  constructor(play) {
    this._play = play;
    /** Ask for the dots until all waves have been counted. */
    this.load = gathering(async () => this._draw(await ask("depths")));
    find("depths-dots").addEventListener("keydown", keyed);
  }

  /** Ring the place of a wave; null: there is none. */
  show(height, wave) {
    this._now = wave && [height, wave.depth];
    this._ring();
  }

  _ring() {
    const isThere = this._now && this._scale;
    find("depths-ring").setAttribute("visibility", isThere ? "visible" : "hidden");
    if (isThere) this._put("depths-ring", this._now);
  }

  _draw({ counts, beyond, left_out: leftOut, done }) {
    const reach = Math.max(4, ...counts.flatMap(({ height, depth }) => [height, depth]));
    const most = reach + beyond;
    this._scale = SIDE / most;
    const corners = [[0, 0], [most, most], [reach, most], [0, beyond]];
    find("depths-band").setAttribute("points", corners.map((corner) => this._at(corner)).join(" "));
    this._put("depths-high", [reach, 0], reach);
    this._put("depths-deep", [0, reach], reach);
    const dots = counts.toSorted((one, other) => other.count - one.count);
    find("depths-dots").replaceChildren(...dots.map((dot, k) => this._dot(dot, k, dots[0].count)));
    for (const kind of ["state", "signal"]) {
      const all = counts.reduce((sum, dot) => sum + (dot.kind === kind ? dot.count : 0), 0);
      write(find(`depths-${kind}`), counted(all, `${kind} wave`));
    }
    write(find("depths-beyond"), `up to ${beyond} hops more, if sensors are equal`);
    write(find("depths-more"), leftOut ? `${counted(leftOut, "wave")} not drawn` : "");
    this._ring();
    return done;
  }

  /** Where a height and a depth are. */
  _at([height, depth]) {
    return [LEFT + height * this._scale, BOTTOM - depth * this._scale];
  }

  _put(id, place, text = "") {
    find(id).setAttribute("transform", `translate(${this._at(place)})`);
    write(find(id), String(text));
  }

  /** A dot; the first is where Tab stops, and arrows go on from there. */
  _dot({ kind, count, height, depth, tick, wave }, number, largest) {
    const half = Math.max(LEAST, MOST * Math.sqrt(count / largest));
    const [x, y] = this._at([height, depth]).map((middle) => middle - half);
    const words = `height ${height}, depth ${depth}: ${counted(count, `${kind} wave`)}; plays the first`;
    const square = { x, y, width: 2 * half, height: 2 * half, rx: kind === "state" ? half : 0 };
    const says = { role: "button", tabindex: number ? -1 : 0, "aria-label": words };
    const dot = shape("rect", { ...square, class: kind, ...says });
    dot.append(shape("title"));
    write(dot.firstChild, words);
    dot.addEventListener("click", () => this._play({ tick, wave }));
    return dot;
  }
}

function keyed(event) {
  const way = WAYS[event.key];
  if (!way && event.key !== "Enter") return;
  event.preventDefault();
  event.stopPropagation(); // the page goes from tick to tick by these
  const dots = [...find("depths-dots").children];
  if (way) dots.at((dots.indexOf(event.target) + way) % dots.length).focus();
  else event.target.dispatchEvent(new Event("click"));
}
