// The comparison of two ticks: of this recording, or of this and another.

import { ask } from "../base/api.js";
import { find, link, make, table, write } from "../base/dom.js";
import { bitWord, drawn, few, literalName } from "../base/literals.js";

const NAMED = 6;
const LISTED = 50; // edges and classes

/** The tab. */
export class CompareView {
  /**
   * @param {string[]} names
   * @param {object} run
   * @param {object} on
   * @param {(tick: number) => void} on.seek
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
    this._with = make("select", { ariaLabel: "Recording to compare with" });
    this._then = make("input", { type: "number", min: 0, step: 1, ariaLabel: "Tick to compare with" });
    this._says = make("p", { className: "quiet" });
    this._body = make("div", { className: "differences" });
    const form = make("p", { className: "bar" }, "Compare with ", this._with, " at tick ", this._then);
    find("compare").replaceChildren(form, this._says, this._body);
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
    this._with.replaceChildren(...others, make("option", { value: own }, "this recording"));
    this._choose();
  }

  /** A tick is shown. */
  show(frame, playing) {
    this._frame = frame;
    if (!playing) this._ask();
  }

  /** Compare with a tick of this recording. */
  withTick(tick) {
    this._with.value = this._own;
    this._then.value = tick;
    this._choose();
    find("tab-compare").click();
    find("tab-compare").focus();
  }

  /** The tab has come up. */
  open() {
    if (this._isOpen) this._ask();
  }

  get _isOpen() {
    return this._runs.length > 0 && !find("compare").hidden;
  }

  get _isOther() {
    return this._with.value !== this._own;
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
    this.open();
  }

  /** Ask for what differs, one question at a time. */
  async _ask() {
    if (this._frame === null || !this._isOpen || this._asking) return;
    const [tick, other, then] = [this._frame.tick, this._with.value, this._tick];
    const asked = [tick, other, then];
    if (String(asked) === String(this._asked)) return;
    this._asking = true;
    this._asked = asked;
    try {
      this._show(await ask("difference", { tick, other, then }));
      write(this._says, "");
    } catch (error) {
      this._body.replaceChildren();
      write(this._says, error.message);
    } finally {
      this._asking = false;
    }
    this._ask(); // there may be another tick by now
  }

  _show(found) {
    const { tick, then, here, there } = found;
    const name = this._isOther ? this._runs[this._with.value].name : "";
    const titles = name ? [`here, tick ${tick}`, `${name}, tick ${then}`] : [`tick ${tick}`, `tick ${then}`];
    const [one, other] = name ? ["here", `in ${name}`] : titles.map((title) => `at ${title}`);
    this._body.replaceChildren(
      this._numbers(found, titles),
      this._only(`${one}, not ${other}`, here),
      this._only(`${other}, not ${one}`, there),
      this._felt(found, titles),
    );
  }

  _numbers({ height, edges, actions }, titles) {
    const did = actions.map((action) => action ?? "no decision");
    const rows = [["height", ...height], ["covering edges", ...edges], ["did", ...did]];
    return table("The two ticks", ["", ...titles], rows);
  }

  /** What one order has and the other lacks. */
  _only(title, { edges, classes, count }) {
    const words = (edge) => [edge.source, edge.target].map((end) => literalName(this._names, end)).join(" → ");
    const items = [
      ...edges.map(({ source, target }) => drawn(source, target)).map((edge) => link(words(edge), () => this._on.pick({ edge }))),
      ...classes.map((members) => few(members.map((a) => literalName(this._names, a)), NAMED, " ≡ ")),
    ].slice(0, LISTED);
    const list = items.map((item) => make("li", {}, item));
    if (count > items.length) list.push(make("li", {}, `and ${count - items.length} more`));
    const heading = make("h3", {}, `Implied ${title} `, make("span", { className: "quiet" }, count));
    return make("section", {}, heading, count ? make("ul", { className: "edges" }, ...list) : quiet("no edge"));
  }

  /** The sensors that differ. */
  _felt({ felt, sensors, tick, then }, titles) {
    const title = make("h3", {}, "Sensors that differ ");
    if (sensors === 0) return make("section", {}, title, quiet("not compared, they share no sensor"));
    const missing = `the state of tick ${tick} or ${then} was not recorded`;
    if (felt === null) return make("section", {}, title, quiet(missing));
    title.append(make("span", { className: "quiet" }, felt.length));
    if (felt.length === 0) return make("section", {}, title, quiet("none"));
    const words = ({ reads, state, contradicted }, side) => {
      const [read, held] = [reads[side], state[side]].map(bitWord);
      const believed = contradicted[side] ? "contradicted" : held;
      return read === believed ? read : `reads ${read}, believed ${believed}`;
    };
    const open = ({ name, sensor }) => link(name, () => this._on.pick({ sensor }));
    const rows = felt.map((each) => [open(each), words(each, 0), words(each, 1)]);
    return make("section", {}, title, table("Sensors that differ", ["Sensor", ...titles], rows));
  }
}

const quiet = (text) => make("p", { className: "quiet" }, text);
