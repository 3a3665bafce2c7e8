// The table of the sensors a run has grown, asked for until all of them are known.

import { ask, gathering } from "../base/api.js";
import { counted, find, link, make, table } from "../base/dom.js";

/** The births of a run, and the panel that lists them. */
export class GrowthView {
  /** `on`: what `seek` a tick, `pick` a sensor, and what to tell of a `change` of what is known. */
  constructor({ sensors, room }, on) {
    this._on = on;
    this._first = sensors.length - room; // the first sensor that may be grown
    this._births = new Map(); // by sensor, in the order of their ticks
    this.room = room;
    this.grows = room > 0;
    this._done = false;
    /** Ask for what there is, until all of it has been read. */
    this.load = gathering(async () => {
      if (!this.grows) return true;
      const grown = await ask("births");
      this._take(grown);
      return grown.done;
    });
    if (!this.grows) for (const id of ["tab-grown", "grown"]) find(id).remove();
  }

  /** Whether a sensor was grown, as far as is known. */
  isGrown(sensor) {
    return this._births.has(sensor);
  }

  /** What a sensor is believed from that nothing reads; empty: it is read. */
  believed = (sensor) => this._births.get(sensor)?.believed;

  /** Whether a sensor is one, as far as is known, and no room for one. */
  isSensor(sensor) {
    return sensor < this._first || this._births.has(sensor);
  }

  /** What is known of them, in order. */
  get births() {
    return [...this._births.values()];
  }

  /** How many sensors there are, in words. */
  get words() {
    const first = counted(this._first, "sensor");
    const so = this._done ? "" : " so far";
    return this.grows ? `${first}, ${this._births.size} grown${so}, room for ${this.room} more` : first;
  }

  _take(grown) {
    const text = JSON.stringify(grown);
    if (text === this._shown) return;
    this._shown = text;
    this.room = grown.room;
    this._done = grown.done;
    this._births = new Map(grown.births.map((birth) => [birth.sensor, birth]));
    this._list(grown);
    this._on.change();
  }

  _list({ births, room, read_to: readTo, done }) {
    const so = done ? "" : ` Read up to tick ${readTo} so far.`;
    const grown = births.length ? counted(births.length, "sensor") : "No sensor";
    const note = `${grown} grown, room for ${room} more.${so}`;
    const titles = ["Sensor", "Tick", "Learned from", "Retired", "Never read, but believed"];
    const all = table("The sensors that were grown", titles, births.map((birth) => this._row(birth)), { id: "grown-list" });
    find("grown").replaceChildren(make("p", { className: "quiet" }, note), all);
  }

  _row({ tick, exact, sensor, name, history, retired, believed }) {
    return [
      link(name, () => this._on.pick(sensor), ""),
      link(`${exact ? "" : "by "}tick ${tick}`, () => this._on.seek(tick), ""),
      history === null ? "not known" : counted(history, "tick"),
      retired === null ? "–" : `tick ${retired}`,
      believed || "–",
    ];
  }
}

/** Why a sensor is not read; empty if it is read. */
export function unread(frame, sensor) {
  if (sensor >= frame.sensors) return "not grown yet";
  return frame.retired.includes(sensor) ? "retired" : "";
}

/** What a decision grew and retired, in words. */
export const changedWords = ({ changed }) =>
  changed.map(({ name, retires }) => `${retires ? "retired" : "grew"} ${name}`).join(", ");
