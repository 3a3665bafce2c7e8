// The strip above the slider: anomalies, alarms, grown sensors and other events.
// Targets reached, beginnings of trajectories, restarts and ticks that are not
// there are among them. The server counts them for stretches of ticks a few pixels wide.

import { ask, gathering } from "../base/api.js";
import { counted, find, make, shape, write } from "../base/dom.js";

const HEIGHT = 16;
const STRETCH = 3; // pixels
const THUMB = 8; // half of the slider's thumb, which stays within its ends

// Counted by stretches; what is painted later lies above. Each with its sign around x, and
// what a count of it is in words.
const SIGNS = {
  missing: { d: (x) => `M${x} 0v${HEIGHT}`, words: (n) => `${counted(n, "tick")} not recorded` },
  begins: { d: (x) => `M${x} ${HEIGHT}v-5`, words: (n) => `${counted(n, "beginning")} of a trajectory` },
  born: { d: (x) => `M${x - 4} ${HEIGHT}l4 -7l4 7z`, words: (n) => `${counted(n, "sensor")} grown` },
  reached: {
    d: (x) => `M${x - 0.75} 0h1.5l6 3.5l-6 3.5v${HEIGHT - 7}h-1.5z`,
    words: (n) => `target reached${n > 1 ? ` ${n} times` : ""}`,
  },
  anomalies: { d: (x) => `M${x - 4} 8l4 -8l4 8z`, words: (n) => `${counted(n, "tick")} with an anomaly` },
  alarms: { d: (x) => `M${x} 0l4 5l-4 5l-4 -5z`, words: (n) => counted(n, "alarm") },
};
const RESUMED = (x) => `M${x} 0v${HEIGHT}`;
// What each sign means, for the help.
const KEY = [
  ["anomalies", SIGNS.anomalies.d, "an anomaly: an observation against what was learned"],
  ["alarms", SIGNS.alarms.d, "an alarm: a sensor that seems broken"],
  ["born", SIGNS.born.d, "a sensor grown"],
  ["reached", SIGNS.reached.d, "the target reached"],
  ["begins", SIGNS.begins.d, "a trajectory begins"],
  ["resumed", RESUMED, "the run was taken up again"],
  ["missing", SIGNS.missing.d, "ticks that were not recorded"],
];

/** The strip. */
export class Strip {
  /**
   * @param {object} on
   * @param {(tick: number) => void} on.seek
   */
  constructor(on) {
    this._home = find("strip");
    this._range = [1, 0];
    this._chosen = null;
    this._marks = null;
    this._gather = gathering(async () => {
      const bins = Math.max(1, Math.floor(this._room / STRETCH));
      const [from, to] = this._range;
      this._marks = await ask("marks", { from, to, bins });
      this._draw();
      return this._marks.done;
    });
    this._at = NaN; // where it was last
    this._title = shape("title");
    this._band = shape("rect", { class: "range", y: 0, height: HEIGHT });
    this._home.addEventListener("pointermove", ({ offsetX: x }) => this._tell(x));
    this._home.addEventListener("click", ({ offsetX: x }) => {
      const at = this._stretch(x);
      if (at !== null) on.seek(this._ticks(at)[0]);
    });
    new ResizeObserver(() => {
      if (this._marks) this._draw(); // at once, as what is asked for may take long
      this.load(...this._range).catch(() => {});
    }).observe(this._home);
    find("signs-list").append(...KEY.flatMap(([name, d, words]) => [
      make("dt", {}, sign(name, d)),
      make("dd", {}, words),
    ]));
  }

  /** Ask for what happened between two ticks, until all of it has been read. */
  async load(first, last) {
    this._range = [first, last];
    if (last >= first) await this._gather();
  }

  /** Show which ticks one looks at; null: all. */
  choose(range) {
    this._chosen = range;
    this._place();
  }

  get _room() {
    return this._home.clientWidth - 2 * THUMB;
  }

  /** How many stretches there are. */
  get _bins() {
    return this._marks?.anomalies.length ?? 0;
  }

  /** Where a tick begins. */
  _across(tick) {
    const { first, last } = this._marks;
    return THUMB + (this._room * (tick - first)) / Math.max(1, last - first + 1);
  }

  _draw() {
    const { resumed, alarms, anomalies } = this._marks;
    // First, as these buttons take of the room of the strip.
    const some = [...alarms, ...anomalies].some((count) => count > 0);
    for (const id of ["anomaly-back", "anomaly-on"]) find(id).hidden = !some;
    const wide = this._room / Math.max(1, this._bins);
    const middle = (at) => THUMB + wide * (at + 0.5);
    const signs = Object.entries(SIGNS).flatMap(([kind, { d }]) =>
      this._marks[kind].flatMap((count, at) => (count ? [shape("path", { class: kind, d: d(middle(at)) })] : [])),
    );
    const again = resumed.map((tick) => shape("path", { class: "resumed", d: RESUMED(this._across(tick + 1)) }));
    this._home.setAttribute("aria-label", `What happened: ${this._words()}`);
    this._home.replaceChildren(this._title, this._band, ...again, ...signs);
    this._place();
    this._tell(this._at);
  }

  /** Put the band of the range that is chosen. */
  _place() {
    if (this._marks === null) return;
    const [from, to] = this._chosen ?? [0, -1];
    this._band.setAttribute("x", from <= to ? this._across(from) : 0);
    this._band.setAttribute("width", from <= to ? this._across(to + 1) - this._across(from) : 0);
  }

  /** All of it in a line, for those who do not see it. */
  _words() {
    const { resumed, done, read_to: readTo } = this._marks;
    const sum = (counts) => counts.reduce((all, one) => all + one, 0);
    const counts = Object.entries(SIGNS).map(([kind, { words }]) => [sum(this._marks[kind]), words]);
    return [
      ...counts.reverse().map(([count, words]) => (count ? words(count) : "")),
      resumed.length ? `taken up again after tick ${resumed.join(", ")}` : "",
      done ? "" : `read up to tick ${readTo} so far`,
    ]
      .filter(Boolean)
      .join("; ");
  }

  /** Which stretch lies at a place; null: none. */
  _stretch(x) {
    const at = Math.floor(((x - THUMB) / this._room) * this._bins);
    return at >= 0 && at < this._bins ? at : null;
  }

  /** The first and the last tick of a stretch. */
  _ticks(at) {
    const { first, last } = this._marks;
    const edge = (k) => Math.ceil(first + ((last - first + 1) * k) / this._bins);
    return [edge(at), edge(at + 1) - 1];
  }

  /** Say what happened where the pointer is, and when that was. */
  _tell(x) {
    this._at = x;
    const at = this._stretch(x);
    if (at === null) return;
    const { resumed, times } = this._marks;
    const [from, to] = this._ticks(at);
    const within = (tick) => from <= tick && tick <= to;
    const when = times[at] === null ? "" : `, ${new Date(times[at] * 1000).toLocaleString()}`;
    const happened = [
      ...Object.entries(SIGNS).reverse().map(([kind, { words }]) => this._marks[kind][at] && words(this._marks[kind][at])),
      ...resumed.filter(within).map((tick) => `taken up again after tick ${tick}`),
    ].filter(Boolean);
    const what = happened.length ? `: ${happened.join(", ")}` : "";
    write(this._title, `tick ${from}${to > from ? ` to ${to}` : ""}${when}${what}`);
  }
}

/** A sign by itself. */
function sign(name, d) {
  const picture = shape("svg", { class: "sign-of-strip", viewBox: `0 0 16 ${HEIGHT}`, "aria-hidden": "true" });
  picture.append(shape("path", { class: name, d: d(8) }));
  return picture;
}
