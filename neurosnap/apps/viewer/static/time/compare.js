// Two ticks beside each other: of this recording, or of this and another; and where two
// recordings part.

import { CompareCurves } from "./compare_curves.js";
import { counted, find, make, write } from "../base/dom.js";
import { bitWord, drawn, few, literalName } from "../base/literals.js";

const AGAIN = 300; // milliseconds until what is not read yet is asked for once more
const NAMED = 6;
const FEW = 8; // edges that are listed before all are asked for
const THINGS = ["readings", "decisions", "states", "orders"];
const WORDS = {
  readings: "readings",
  decisions: "decisions",
  states: "believed states",
  orders: "learned orders",
};

/** The tab. */
export class CompareView {
  /**
   * @param {string[]} names
   * @param {object} run
   * @param {object} on
   * @param {(other: number) => Promise<object>} on.fetchPartings
   * @param {(tick: number, other: number, then: number) => Promise<object>} on.fetchDifference
   * @param {Function} on.fetchSeries
   * @param {Function} on.fetchSeriesOf
   * @param {(tick: number) => void} on.seek
   * @param {(from: number, to: number) => void} on.range
   * @param {(thing: object) => void} on.pick
   */
  constructor(names, run, on) {
    this._names = names;
    this._run = run;
    this._on = on;
    this._own = "0";
    this._runs = [];
    this._frame = null;
    this._asked = null; // what the difference that is shown is of
    this._found = null;
    this._with = make("select", { ariaLabel: "Recording to compare with" });
    this._then = make("input", { type: "number", min: 0, step: 1, ariaLabel: "Tick to compare with" });
    this._says = make("p", { className: "quiet" });
    this._parts = make("div", { className: "parts" });
    this._body = make("div", { className: "differences" });
    this._curves = new CompareCurves(run.columns, on);
    const form = make("p", { className: "bar" }, "Compare with ", this._with, " at tick ", this._then);
    const words = make("div", {}, form, this._says, this._parts, this._body);
    find("compare").replaceChildren(words, this._curves.home);
    this._with.addEventListener("change", () => this._choose());
    this._then.addEventListener("input", () => this._ask());
  }

  /** Say which recordings there are, and the number of the one that is looked at. */
  offer(runs, own) {
    this._runs = runs;
    this._own = own;
    const others = runs.flatMap(({ name }, number) =>
      String(number) === own ? [] : [make("option", { value: number }, name)],
    );
    this._with.replaceChildren(
      ...others,
      make("option", { value: own }, "this recording"),
    );
    this._choose();
  }

  /** A tick is shown. */
  show(frame, playing) {
    this._frame = frame;
    this._curves.at(frame);
    if (!playing) this._ask();
  }

  /** Draw curves over some ticks only; null: over all. */
  load(range) {
    this._curves.load(range);
  }

  /** Compare with a tick of this recording; without: the one before. */
  withTick(tick = "") {
    this._with.value = this._own;
    this._then.value = tick;
    this._choose();
    find("tab-compare").click();
    find("tab-compare").focus();
  }

  /** The tab has come up. */
  open() {
    if (!this._isOpen) return;
    this._ask();
    if (this._isOther) this._follow(this._other);
  }

  /** What is shown, all of it. */
  rows() {
    if (!this._found) return [["what"]];
    const { height, edges, actions, here, there, felt } = this._found;
    const names = (members) => members.map((a) => literalName(this._names, a)).join(" ≡ ");
    const only = ({ edges: some, edge_count: count, classes, class_count: classCount }) => [
      ...some.map(({ source, target }) => ["implied", this._words(drawn(source, target))]),
      ...classes.map((members) => ["equivalent", names(members)]),
      ...[count - some.length, classCount - classes.length].map((more, k) =>
        more > 0 ? [["implied", "equivalent"][k], `and ${more} more`] : null,
      ),
    ].filter(Boolean);
    const [one, other] = this._titles(this._found);
    return [
      ["what", "of", one, other],
      ["height", "", ...height],
      ["covering edges", "", ...edges],
      ["did", "", ...actions],
      ...only(here).map((row) => [...row, 1, 0]),
      ...only(there).map((row) => [...row, 0, 1]),
      ...(felt ?? []).flatMap((each) => [
        ["reads", each.name, ...each.reads.map(bitWord)],
        ["believed", each.name, ...[0, 1].map((side) => heldWord(each, side))],
      ]),
    ];
  }

  /** The scheme of colours has changed. */
  recolour() {
    this._curves.recolour();
  }

  get _isOpen() {
    return this._runs.length > 0 && !find("compare").hidden;
  }

  get _other() {
    return this._with.value;
  }

  get _isOther() {
    return this._other !== this._own;
  }

  /** The tick there: the same one of another recording, the one before of this. */
  get _tick() {
    if (this._then.value !== "") return Number(this._then.value);
    const { tick } = this._frame;
    return this._isOther ? tick : Math.max(tick - 1, this._run.first === 1 ? 0 : tick);
  }

  _choose() {
    this._then.placeholder = this._isOther ? "same" : "before";
    this._asked = null;
    this._parts.replaceChildren();
    const other = this._isOther ? this._runs[this._other] : null;
    this._curves.compare(other && { number: this._other, ...other });
    if (!this._isOpen) return;
    this._ask();
    if (this._isOther) this._follow(this._other);
  }

  /** Ask for what differs, one question at a time. */
  async _ask() {
    if (this._frame === null || !this._isOpen || this._asking) return;
    const asked = [this._frame.tick, this._other, this._tick];
    if (String(asked) === String(this._asked)) return;
    this._asking = true;
    this._asked = asked;
    try {
      this._show(await this._on.fetchDifference(...asked));
      write(this._says, "");
    } catch (error) {
      this._found = null;
      this._body.replaceChildren();
      write(this._says, error.message);
    } finally {
      this._asking = false;
    }
    this._ask(); // there may be another tick by now
  }

  /** Ask where two recordings part until that is known. */
  async _follow(other) {
    for (let done = false; !done && this._isOpen && this._other === other; ) {
      let found;
      try {
        found = await this._on.fetchPartings(other);
      } catch {
        return; // said where it was asked
      }
      if (this._other !== other) return;
      this._showParts(found);
      done = found.done;
      if (!done) await new Promise((soon) => setTimeout(soon, AGAIN));
    }
  }

  _showParts(found) {
    const { first, last, read_to: readTo, done, sensors } = found;
    const range = `ticks ${first} to ${done ? last : readTo}`;
    const far = done ? range : `${range}, up to tick ${last} still to be read`;
    const items = THINGS.map((thing) => this._part(thing, found[thing], done));
    const lacks = [
      ["only here", found.only_here],
      ["only there", found.only_there],
    ].flatMap(([where, some]) =>
      some.length ? [make("p", { className: "quiet" }, `${where}: ${few(some, NAMED)}`)] : [],
    );
    this._parts.replaceChildren(
      make("h3", {}, "Where they part"),
      make("p", { className: "quiet" }, `${far}; ${counted(sensors, "sensor")} in both`),
      ...lacks,
      make("ul", {}, ...items),
    );
  }

  _part(thing, { tick, differing, compared }, done) {
    if (compared === 0) return make("li", {}, `${WORDS[thing]}: recorded in both at no tick`);
    if (tick === null) {
      return make("li", {}, `${WORDS[thing]}: the same${done ? "" : " so far"}`);
    }
    const go = make("button", { type: "button", className: "link" }, `tick ${tick}`);
    go.addEventListener("click", () => this._on.seek(tick));
    const often = differing === null ? "" : `; they differ at ${differing} of ${compared} ticks`;
    return make("li", {}, `${WORDS[thing]} part at `, go, often);
  }

  /** What the two ticks are called. */
  _titles({ tick, then }) {
    if (!this._isOther) return [`tick ${tick}`, `tick ${then}`];
    return [`here, tick ${tick}`, `${this._runs[this._other].name}, tick ${then}`];
  }

  _show(found) {
    this._found = found;
    const { here, there } = found;
    const name = this._isOther ? this._runs[this._other].name : "";
    const titles = this._titles(found);
    const [one, other] = name ? ["here", `in ${name}`] : titles.map((title) => `at ${title}`);
    this._body.replaceChildren(
      this._numbers(found, titles),
      this._only(`${one}, not ${other}`, here),
      this._only(`${other}, not ${one}`, there),
      this._felt(found, titles),
    );
  }

  _numbers({ height, edges, actions, only_sensors: only }, titles) {
    const rows = [
      ["height", height],
      ["covering edges", edges],
      ["did", actions.map((action) => action ?? "no decision")],
      ...(only.flat().length ? [["sensors only there are", only.map((some) => some.length)]] : []),
    ];
    return table("The two ticks", ["", ...titles], rows.map(([name, pair]) => [name, ...pair]));
  }

  /** What one order has and the other lacks. */
  _only(title, { edges, edge_count: count, classes, class_count: classCount }) {
    const all = edges.map(({ source, target }) => drawn(source, target));
    const list = make("ul", { className: "edges" });
    const add = (some) => list.append(...some.map((edge) => make("li", {}, this._edge(edge))));
    add(all.slice(0, FEW));
    const titled = (what, many) =>
      make("h3", {}, `${what} ${title} `, make("span", { className: "quiet" }, many));
    const heading = titled("Implied", count);
    const parts = [heading, count ? list : make("p", { className: "quiet" }, "no edge")];
    if (all.length > FEW) {
      const more = make("button", { type: "button" }, `Show ${all.length === count ? "all" : "the first"} ${all.length}`);
      more.addEventListener("click", () => {
        more.remove();
        add(all.slice(FEW));
      });
      parts.push(more);
    }
    const same = classes.slice(0, FEW).map((members) => this._class(members));
    const left = classCount - same.length;
    if (left > 0) same.push(make("li", {}, `and ${counted(left, "other class")}`));
    if (same.length) parts.push(titled("The same", classCount), make("ul", {}, ...same));
    return make("section", {}, ...parts);
  }

  /** Sensors that are the same, a line; of many some, and a button for the others. */
  _class(members) {
    const names = members.map((a) => literalName(this._names, a));
    const item = make("li", {}, names.slice(0, NAMED).join(" ≡ "), " ");
    const more = names.length - NAMED;
    if (more > 0) {
      const all = make("button", { type: "button" }, `and ${more} more`);
      all.addEventListener("click", () => item.replaceChildren(names.join(" ≡ ")));
      item.append(all);
    }
    return item;
  }

  _words({ source, target }) {
    return `${literalName(this._names, source)} → ${literalName(this._names, target)}`;
  }

  _edge(edge) {
    const open = make("button", { type: "button", className: "link" }, this._words(edge));
    open.addEventListener("click", () => this._on.pick({ edge }));
    return open;
  }

  /** The sensors that differ. */
  _felt({ felt, tick, then }, titles) {
    const missing = `the state of tick ${tick} or ${then} was not recorded`;
    const title = make("h3", {}, "Sensors that differ ");
    if (felt === null) return make("section", {}, title, make("p", { className: "quiet" }, missing));
    title.append(make("span", { className: "quiet" }, felt.length));
    if (felt.length === 0) return make("section", {}, title, make("p", { className: "quiet" }, "none"));
    const words = (each, side) => {
      const [read, held] = [bitWord(each.reads[side]), heldWord(each, side)];
      return read === held ? read : `reads ${read}, believed ${held}`;
    };
    const rows = felt.map((each) => {
      const open = make("button", { type: "button", className: "link" }, each.name);
      open.addEventListener("click", () => this._on.pick({ sensor: each.sensor }));
      return [open, words(each, 0), words(each, 1)];
    });
    return make("section", {}, title, table("Sensors that differ", ["Sensor", ...titles], rows));
  }
}

/** What is believed here (0) or there (1) of a sensor that differs. */
const heldWord = ({ state, contradicted }, side) =>
  contradicted[side] ? "contradicted" : bitWord(state[side]);

function table(caption, titles, rows) {
  const head = titles.map((title) => make(title ? "th" : "td", title ? { scope: "col" } : {}, title));
  const cells = rows.map(([name, ...rest]) =>
    make("tr", {}, make("th", { scope: "row" }, name), ...rest.map((text) => make("td", {}, String(text)))),
  );
  return make(
    "table",
    {},
    make("caption", { className: "unseen" }, caption),
    make("thead", {}, make("tr", {}, ...head)),
    make("tbody", {}, ...cells),
  );
}
