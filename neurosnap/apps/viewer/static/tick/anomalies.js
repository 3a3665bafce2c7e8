// The card of an anomaly: suspected sensors, and the implications they break.

import { find, link, make } from "../base/dom.js";
import { drawn, literalName } from "../base/literals.js";

const SHOWN = 5; // broken implications that are listed
const NAMED = 4; // sensors that are named before all are asked for

/** The card, in the panel of the tick. */
export class AnomalyCard {
  /** @param {string[]} names @param {(thing: object) => void} pick */
  constructor(names, pick) {
    this._names = names;
    this._pick = pick;
    this._home = find("anomaly");
  }

  show({ anomaly, tick }) {
    const text = JSON.stringify([anomaly, tick]);
    if (text === this._shown) return;
    this._shown = text;
    this._home.hidden = anomaly === null;
    if (anomaly === null) {
      this._home.replaceChildren();
      return;
    }
    const { culprits, others, exact, broken, more, since } = anomaly;
    const likely = culprits.length ? this._sensors(culprits) : ["no sensor"];
    const perhaps = others.length ? [" or ", ...this._sensors(others)] : [];
    const how = `${exact ? "" : " (at least)"} may be wrong`;
    const began = since < tick ? `, since tick ${since}` : "";
    const items = broken.slice(0, SHOWN).map((one) => this._broken(one));
    const left = more + Math.max(0, broken.length - SHOWN);
    this._home.replaceChildren(
      make("h3", {}, "Anomaly"),
      make("p", {}, ...likely, ...perhaps, `${how}${began}: it breaks`),
      make("ul", {}, ...items, ...(left ? [make("li", {}, `and ${left} more`)] : [])),
    );
  }

  /** Sensors by name, each a button; of many some, and a button for the others. */
  _sensors(sensors) {
    const named = (some) => some.flatMap((sensor, k) => [k ? ", " : "", this._sensor(sensor)]);
    const more = sensors.length - NAMED;
    if (more < 2) return named(sensors);
    const rest = () => named(sensors.slice(NAMED));
    const all = link(`and ${more} more`, () => all.replaceWith(", ", ...rest()), "");
    return [...named(sensors.slice(0, NAMED)), " ", all];
  }

  _sensor(sensor) {
    return link(this._names[sensor], () => this._pick({ sensor }));
  }

  _broken({ source, target, evidence }) {
    const [from, to] = [source, target].map((one) => literalName(this._names, one));
    const open = link(`${from} → ${to}`, () => this._pick({ edge: drawn(source, target) }));
    return make("li", {}, open, ` ${evidence}`);
  }
}

// The alarms in force at a tick: which sensors seemed broken by then, since when and why.

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
    const open = link(name, () => this._pick({ sensor }));
    return [open, line.slice(name.length)];
  }
}
