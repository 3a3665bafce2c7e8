// The facts of a tick, in a few lines.

import { counted, find, make, write } from "../base/dom.js";
import { few } from "../base/literals.js";
import { term } from "../base/terms.js";
import { changedWords, unread } from "../run/growth.js";

const WORDS = ["did", "plan", "why", "grown", "contradicted", "not read"];
const NUMBERS = ["edges", "height", "depth", "pulses"];
const NAMED = 6;

/** The panel of the tick. */
export class FactsView {
  /** @param {string[]} names @param {{actions: string[], options: object, room: number}} run */
  constructor(names, { actions, options, room }) {
    this._names = names;
    this._actions = actions;
    const idle = actions.length ? [] : ["did", "why"]; // nothing is decided
    const without = [...idle, ...(options.imagine ? [] : ["plan"]), ...(room ? [] : ["grown"])];
    const facts = [...WORDS, ...NUMBERS].filter((fact) => !without.includes(fact));
    this._values = new Map(facts.map((fact) => [fact, make("dd", {}, "–")]));
    for (const fact of facts) {
      const className = NUMBERS.includes(fact) ? "small" : "";
      find("now").append(
        make("div", { className }, make("dt", {}, term(fact)), this._values.get(fact)),
      );
    }
  }

  /**
   * Show a tick.
   *
   * @param {object} frame
   * @param {object|null|undefined} before the frame of the tick before, if it is here
   */
  show(frame, before) {
    write(find("now-at"), frame.at);
    find("now-begins").hidden = !frame.begins;
    find("now-intake").hidden = frame.intake.length === 0;
    find("now-intake").textContent = frame.intake.join("; ");
    const set = (fact, text) => this._values.has(fact) && write(this._values.get(fact), text);
    set("did", this._did(frame, before));
    this._plan(frame.plan);
    set("why", frame.plan?.why || frame.why || "–"); // of a plan the steps are shown beside it
    set("grown", changedWords(frame) || "nothing");
    for (const fact of NUMBERS) set(fact, String(frame[fact]));
    set("contradicted", this._contradicted(frame));
    const born = frame.changed.map(({ sensor }) => sensor); // read from the next tick on
    const silent = this._names.filter(
      (_, sensor) =>
        frame.bits[sensor] === null && !unread(frame, sensor) && !born.includes(sensor),
    );
    set("not read", few(silent, NAMED) || "none");
  }

  /** What was decided; a tick has its state before it has its decision. */
  _did({ action, choice }, before) {
    if (action !== null) return action;
    if (choice >= 0) return "nothing";
    const last = before?.action ? `; at tick ${before.tick}: ${before.action}` : "";
    return `no decision${last}`;
  }

  _plan(plan) {
    const home = this._values.get("plan");
    const key = JSON.stringify(plan);
    if (home === undefined || key === this._planned) return;
    this._planned = key;
    home.replaceChildren(plan ? stepsOf(plan, this._actions) : "none");
  }

  _contradicted({ contradicted, incoherent }) {
    const named = few(contradicted.map((sensor) => this._names[sensor]), NAMED);
    if (named) return named;
    return incoherent ? "what was observed contradicts what was learned" : "nothing";
  }
}

// A plan: its steps in a row, this one and those to come.

/** Return a list of the steps of a plan. */
function stepsOf({ steps, more }, actions) {
  const items = steps.map((action) => make("li", {}, actions[action]));
  items[0].setAttribute("aria-current", "step");
  if (more > 0) items.push(make("li", { className: "more" }, `${more} more`));
  const label = `Plan: ${counted(steps.length + more, "step")} to go`;
  return make("ol", { className: "plan", ariaLabel: label }, ...items);
}
