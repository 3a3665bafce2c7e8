// What happened when, in a strip over the slider: anomalies, edges rewired, beginnings of
// trajectories, restarts. The server counts them for stretches of ticks a few pixels wide.

import { counted, find, shape, write } from "./dom.js";

const AGAIN = 700; // milliseconds until what is not read yet is asked for once more
const HEIGHT = 14;
const STRETCH = 3; // pixels
const THUMB = 8; // half of the slider's thumb, which stays within its ends

/** The strip. */
export class Strip {
  /**
   * @param {object} on
   * @param {(from: number, to: number, bins: number) => Promise<object>} on.fetchMarks
   * @param {(tick: number) => void} on.seek
   */
  constructor(on) {
    this._on = on;
    this._home = find("strip");
    this._range = [1, 0];
    this._marks = null;
    this._loading = false;
    this._home.addEventListener("pointermove", (event) => this._tell(event.offsetX));
    this._home.addEventListener("click", (event) => {
      const at = this._stretch(event.offsetX);
      if (at !== null) on.seek(this._ticks(at)[0]);
    });
    new ResizeObserver(() => this.load(...this._range).catch(() => {})).observe(this._home);
  }

  /** Ask for what happened between two ticks, until all of it has been read. */
  async load(first, last) {
    this._range = [first, last];
    this._due = true; // there may be more than was asked for
    if (this._loading || last < first) return;
    this._loading = true;
    try {
      for (let done = false; !done || this._due; ) {
        this._due = false;
        const bins = Math.max(1, Math.floor(this._room / STRETCH));
        this._marks = await this._on.fetchMarks(...this._range, bins);
        this._draw();
        done = this._marks.done;
        if (!done || this._due) await new Promise((resolve) => setTimeout(resolve, AGAIN));
      }
    } finally {
      this._loading = false;
    }
  }

  get _room() {
    return this._home.clientWidth - 2 * THUMB;
  }

  _draw() {
    const { anomalies, rewired, begins, resumed, first, last } = this._marks;
    const wide = this._room / Math.max(1, anomalies.length);
    const middle = (at) => THUMB + wide * (at + 0.5);
    const most = Math.log1p(Math.max(1, ...rewired));
    const marks = [];
    rewired.forEach((edges, at) => {
      if (edges === 0) return;
      const height = 2 + ((HEIGHT - 2) * Math.log1p(edges)) / most;
      const [x, y] = [middle(at) - 1, HEIGHT - height];
      marks.push(shape("rect", { class: "rewired", x, y, width: 2, height }));
    });
    begins.forEach((count, at) => {
      if (count) marks.push(shape("path", { class: "begins", d: `M${middle(at)} ${HEIGHT}v-5` }));
    });
    anomalies.forEach((count, at) => {
      if (count) {
        const d = `M${middle(at)} 0l4 8h-8z`;
        marks.push(shape("path", { class: "anomaly", d }));
      }
    });
    for (const tick of resumed) {
      const x = THUMB + (this._room * (tick - first + 1)) / Math.max(1, last - first + 1);
      marks.push(shape("path", { class: "resumed", d: `M${x} 0v${HEIGHT}` }));
    }
    this._title = shape("title");
    this._home.setAttribute("aria-label", `What happened: ${this._words()}`);
    this._home.replaceChildren(this._title, ...marks);
    const some = anomalies.some((count) => count > 0);
    for (const id of ["anomaly-back", "anomaly-on"]) find(id).hidden = !some;
  }

  /** All of it in a line, for those who do not see it. */
  _words() {
    const { anomalies, rewired, begins, resumed, done, read_to: readTo } = this._marks;
    const sum = (counts) => counts.reduce((all, one) => all + one, 0);
    const changed = rewired.filter((edges) => edges > 0).length;
    return [
      counted(sum(anomalies), "tick") + " with an anomaly",
      changed ? `edges rewired at ${counted(changed, "place")}` : "",
      counted(sum(begins), "beginning") + " of a trajectory",
      resumed.length ? `taken up again after tick ${resumed.join(", ")}` : "",
      done ? "" : `read up to tick ${readTo} so far`,
    ]
      .filter(Boolean)
      .join("; ");
  }

  /** Which stretch lies at a place; null: none. */
  _stretch(x) {
    const count = this._marks?.anomalies.length ?? 0;
    const at = Math.floor(((x - THUMB) / this._room) * count);
    return at >= 0 && at < count ? at : null;
  }

  /** The first and the last tick of a stretch. */
  _ticks(at) {
    const { first, last, anomalies } = this._marks;
    const edge = (k) => Math.ceil(first + ((last - first + 1) * k) / anomalies.length);
    return [edge(at), edge(at + 1) - 1];
  }

  /** Say what happened where the pointer is, and when that was. */
  _tell(x) {
    const at = this._stretch(x);
    if (at === null) return;
    const { anomalies, rewired, begins, times } = this._marks;
    const [from, to] = this._ticks(at);
    const when = times[at] === null ? "" : `, ${new Date(times[at] * 1000).toLocaleString()}`;
    const happened = [
      anomalies[at] ? counted(anomalies[at], "tick") + " with an anomaly" : "",
      rewired[at] ? `${counted(rewired[at], "edge")} rewired` : "",
      begins[at] ? "a trajectory begins" : "",
    ].filter(Boolean);
    const what = happened.length ? `: ${happened.join(", ")}` : "";
    write(this._title, `tick ${from}${to > from ? ` to ${to}` : ""}${when}${what}`);
  }
}
