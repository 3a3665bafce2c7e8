// The findings: which sensors were at fault, since when, and what was read around that.
// The list is made anew only when there is something new in it.

import { ask, gathering } from "../base/api.js";
import { find, link, make, palette, repainted, table, write } from "../base/dom.js";
import { bytes, imageOf } from "../time/raster.js";

const [WIDE, HIGH] = [120, 14]; // pixels of the readings of a sensor
const REST = 1000; // milliseconds between two questions while the run goes on
const NAMED = 8; // sensors that are named in the card

/** The tab of all findings, and the card of those at a tick. */
export class FindingsView {
  /**
   * @param {string[]} names
   * @param {object} on
   * @param {() => boolean} on.isLive
   * @param {(tick: number) => void} on.seek
   * @param {(sensor: number) => void} on.pick
   * @param {(done: boolean) => void} on.change told of anything new
   */
  constructor(names, on) {
    this._names = names;
    this._on = on;
    this.listed = []; // the newest first
    /** Ask for what there is, until all of it has been read. */
    this.load = gathering(async () => {
      const found = await ask("findings");
      this._take(found);
      if (on.isLive()) await new Promise((soon) => setTimeout(soon, REST));
      return found.done;
    });
    repainted(() => this._draw());
  }

  /** The sensors at fault at a tick, and the rules that they break. */
  marks({ anomaly, tick }) {
    const alarmed = this._alarms(tick).map(({ sensors }) => sensors[0]);
    const rules = anomaly?.rule ? [anomaly.rule] : [];
    return { sensors: [...(anomaly?.culprits ?? []), ...alarmed], rules };
  }

  /** Say in the panel of the tick what is wrong at it. */
  show({ anomaly, tick }) {
    const told = [...(anomaly ? [anomaly] : []), ...this._alarms(tick)];
    const text = JSON.stringify(told);
    if (text === this._told) return;
    this._told = text;
    find("finding").hidden = told.length === 0;
    find("finding").replaceChildren(...told.flatMap((one) => {
      const { sentence, sensors, culprits = sensors.slice(0, 1), others = [] } = one;
      const suspects = [...culprits, ...others].slice(0, NAMED);
      const named = suspects.flatMap((sensor) => [" ", link(this._names[sensor], () => this._on.pick(sensor))]);
      return [make("p", {}, sentence), make("p", { className: "quiet" }, "may be wrong:", ...named)];
    }));
  }

  /** The alarms in force at a tick. */
  _alarms(tick) {
    const isInForce = (one) => one.alarm && one.tick <= tick && tick <= (one.last ?? Infinity);
    return this.listed.filter(isInForce);
  }

  _take(found) {
    const { read_to: readTo, done, ...rest } = found;
    const text = JSON.stringify([rest, done, rest.findings.length ? 0 : readTo]);
    if (text === this._known) return;
    this._known = text;
    this._found = found;
    this.listed = found.findings;
    this._draw();
    this._on.change(done);
  }

  _draw() {
    if (!this._found) return;
    const { findings, left_out: leftOut, done } = this._found;
    const count = findings.length + leftOut;
    const more = done || this._on.isLive() ? "" : " …"; // the rest of the run is still being read
    write(find("tab-findings"), `Findings${count ? ` ${count}` : ""}${more}`);
    const titles = ["Sensor", "What was wrong", "Began", "Lasted", "State", "Readings"];
    const list = table("The findings, the newest first", titles, findings.map((one) => this._row(one)));
    for (const [number, row] of list.querySelectorAll("tbody tr").entries()) {
      row.dataset.state = findings[number].state;
      row.addEventListener("click", () => this._on.seek(findings[number].tick));
    }
    const says = make("p", { className: "quiet" }, this._words());
    find("findings").replaceChildren(...(count ? [list] : []), says);
  }

  /** What there is to say besides the list, or in its place. */
  _words() {
    const { findings, left_out: leftOut, looked, progress, done, read_to: readTo } = this._found;
    const none = looked
      ? `No findings in ${readTo} ticks${done ? "" : ", read so far"}.`
      : "No findings: this run was started without --anomalies and --alarms.";
    const older = leftOut ? `${leftOut} older ones are not listed.` : "";
    return [findings.length ? older : none, progress].filter(Boolean).join(" ");
  }

  _row(finding) {
    const { sensors, first, what, sentence, began, lasted, state } = finding;
    const when = [make("b", {}, `tick ${first}`), ...(began ? [make("br"), began] : [])];
    return [
      link(this._names[sensors[0]], () => {}), // a click on the row goes there
      make("span", {}, make("b", {}, what), make("br"), sentence),
      make("span", {}, ...when),
      lasted || "–",
      state,
      this._readings(finding),
    ];
  }

  /** The readings around the beginning: a line a sensor, with a frame around the fault. */
  _readings({ first, last, sensors, around }) {
    const names = sensors.map((sensor) => this._names[sensor]);
    const label = `Readings of ${names.join(" and ")}`;
    const size = { width: WIDE, height: HIGH * around.length };
    const canvas = make("canvas", { role: "img", ariaLabel: label, ...size });
    const context = canvas.getContext("2d");
    const colours = palette();
    context.imageSmoothingEnabled = false;
    around.forEach(({ values, columns }, row) => {
      if (columns === 0) return; // not read yet
      const image = imageOf(colours, bytes(values), columns, 1, 1);
      context.drawImage(image, 0, row * HIGH + 2, WIDE, HIGH - 4);
    });
    const { first: from, step, columns } = around[0];
    const across = (at) => Math.min(WIDE, ((at - from) / (step * columns)) * WIDE);
    context.strokeStyle = colours.bad;
    context.lineWidth = 2;
    const [left, right] = [across(first), across((last ?? Infinity) + 1)];
    context.strokeRect(left - 2, 1, right - left + 4, HIGH - 2);
    const words = names.flatMap((name, row) => (row ? [make("br"), name] : [name]));
    return make("span", { className: "readings" }, canvas, make("span", { className: "quiet" }, ...words));
  }
}
