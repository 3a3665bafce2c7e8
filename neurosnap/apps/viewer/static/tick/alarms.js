// The alarms in force at a tick: which sensors seemed broken by then, since when and why.

import { find, make } from "../base/dom.js";

/** The card, in the panel of the tick. */
export class AlarmCard {
  /** @param {string[]} names @param {(thing: object) => void} pick */
  constructor(names, pick) {
    this._names = names;
    this._pick = pick;
    this._home = find("alarms");
    this._raised = [];
    this._tick = null;
  }

  /** Know the alarms of the run, as far as it was read. */
  know(raised) {
    this._raised = raised;
    this._draw();
  }

  show({ tick }) {
    this._tick = tick;
    this._draw();
  }

  _draw() {
    const isInForce = ({ tick, until }) => tick <= this._tick && (until ?? Infinity) > this._tick;
    const now = this._raised.filter(isInForce);
    const text = JSON.stringify(now);
    if (text === this._shown) return;
    this._shown = text;
    this._home.hidden = now.length === 0;
    const title = make("h3", {}, now.length > 1 ? "Alarms" : "Alarm");
    const items = now.map((alarm) => make("li", {}, ...this._words(alarm)));
    this._home.replaceChildren(title, make("ul", {}, ...items));
  }

  /** Its line, which begins with the sensor: that is a button. */
  _words({ sensor, line }) {
    const name = this._names[sensor];
    const open = make("button", { type: "button", className: "link" }, name);
    open.addEventListener("click", () => this._pick({ sensor }));
    return [open, line.slice(name.length)];
  }
}
