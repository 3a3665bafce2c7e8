// What a tick taught: how many implications are new since the tick before, and how many are
// gone. It follows from the two ticks alone, and a click compares them.

import { counted, find, write } from "../base/dom.js";

/** The button in the head of the diagram. */
export class OrderChanges {
  /**
   * @param {string} run the number of the recording
   * @param {(tick: number, other: string, then: number) => Promise<object>} fetchDifference
   */
  constructor(run, fetchDifference) {
    this._run = run;
    this._fetch = fetchDifference;
    this._button = find("order-changed");
    this._wanted = null;
  }

  /**
   * Show a tick.
   *
   * @param {object} frame
   * @param {object|null|undefined} before the frame of the tick before, if it is here
   * @param {boolean} playing nothing is asked then
   */
  show(frame, before, playing) {
    const { tick, graph } = frame;
    if (tick === this._tick && !this._skipped) return;
    [this._tick, this._skipped] = [tick, playing];
    this._button.hidden = true;
    this._wanted = null;
    if (playing || tick < 2 || graph === "" || before?.graph === graph) return;
    this._wanted = tick;
    if (!this._asking) this._ask();
  }

  async _ask() {
    this._asking = true;
    while (this._wanted !== null) {
      const tick = this._wanted;
      this._wanted = null;
      try {
        const found = await this._fetch(tick, this._run, tick - 1);
        if (this._tick === tick) this._say(found);
      } catch {
        // The tick before cannot be known: then there is nothing to say.
      }
    }
    this._asking = false;
  }

  _say({ tick, here, there }) {
    const [more, fewer] = [here, there].map((one) => one.edge_count + one.class_count);
    this._button.hidden = more + fewer === 0;
    const parts = [more ? `+${more}` : "", fewer ? `−${fewer}` : ""].filter(Boolean);
    write(this._button, `${parts.join(" ")} at this tick`);
    const words = `${counted(more, "implication")} more and ${fewer} fewer than at tick ${tick - 1}: compare`;
    this._button.title = words;
  }
}
