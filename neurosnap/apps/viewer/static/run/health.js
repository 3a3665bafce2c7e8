// The panel of the health of a home's sensors.
// It is asked for until all of the readings are counted.

import { Gathering } from "../base/api.js";
import { counted, find, make, table, write } from "../base/dom.js";

/** The panel of the sensors' health. */
export class HealthView {
  /** @param {{options: object}} run @param {() => Promise<object>} fetchHealth */
  constructor({ options }, fetchHealth) {
    this._judges = (options.alarms ?? "never") !== "never";
    this._gathering = new Gathering(async () => {
      const health = await fetchHealth();
      this._show(health);
      return health.done;
    });
    if (!this._judges) for (const id of ["tab-health", "health"]) find(id).remove();
  }

  /** Ask for what there is, until all of it has been read. */
  async load() {
    if (this._judges) await this._gathering.load();
  }

  _show(health) {
    const text = JSON.stringify(health);
    if (text === this._shown) return;
    this._shown = text;
    const { progress, alarms, sensors, read_to: readTo, done } = health;
    const bad = alarms.length ? `: ${counted(alarms.length, "alarm")}` : "";
    write(find("tab-health"), `Health${bad}`);
    const so = done ? "" : `; read up to tick ${readTo} so far`;
    const all = table("The health of the sensors", ["Sensor", "Health"], sensors.map(row));
    find("health").replaceChildren(
      make("p", { className: "quiet" }, `${progress}${so}`),
      ...alarms.map((alarm) => make("p", { className: "alarm" }, alarm)),
      all,
    );
  }
}

function row({ sensor, known, health }) {
  const words = health > 0 ? `${Math.round(100 * health)} %` : "in alarm";
  return [sensor, known ? words : "not known yet"];
}
