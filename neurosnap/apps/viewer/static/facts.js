// What there is to say about a tick, in a few lines.

import { find, make, write } from "./dom.js";
import { few } from "./literals.js";

const WORDS = ["did", "why", "contradicted", "not read"];
const NUMBERS = ["edges", "height", "depth", "pulses"];
const NAMED = 6;

/** The panel of the tick. */
export class FactsView {
  /** @param {string[]} names */
  constructor(names) {
    this._names = names;
    const facts = [...WORDS, ...NUMBERS];
    this._values = new Map(facts.map((fact) => [fact, make("dd", {}, "–")]));
    for (const fact of facts) {
      const className = NUMBERS.includes(fact) ? "small" : "";
      find("now").append(
        make("div", { className }, make("dt", {}, fact), this._values.get(fact)),
      );
    }
  }

  show(frame) {
    const set = (fact, text) => write(this._values.get(fact), text);
    set("did", frame.action ?? "nothing");
    set("why", frame.why || "–");
    for (const fact of NUMBERS) set(fact, String(frame[fact]));
    set("contradicted", this._contradicted(frame));
    const unread = this._names.filter((_, sensor) => frame.bits[sensor] === null);
    set("not read", few(unread, NAMED) || "none");
  }

  _contradicted({ contradicted, incoherent }) {
    const named = few(contradicted.map((sensor) => this._names[sensor]), NAMED);
    if (named) return named;
    return incoherent ? "what was observed contradicts what was learned" : "nothing";
  }
}
