// The learned orders, by their ids: fetched once each, one question at a time, and always
// for the tick that is wanted now. While it plays and learns, an answer is of a tick that
// has passed: it is handed on all the same, being nearer than what was there before.

import { run } from "../base/api.js";
import { counted, find, write } from "../base/dom.js";

const KEPT = 60;

/** Graphs by id. */
export class Orders {
  /**
   * @param {(tick: number) => Promise<object>} fetchGraph says itself what goes wrong
   */
  constructor(fetchGraph) {
    this._fetch = fetchGraph;
    this._known = new Map();
    this._wanted = null;
    this._asking = false;
  }

  /** The order of a frame, if it is here; if not, `arrived` gets it, or one before it. */
  of(frame, arrived) {
    const graph = this._known.get(frame.graph) ?? null;
    // An order without an id cannot be known: the recording lacks what it was learned from.
    const isMissing = graph === null && frame.graph !== "";
    this._wanted = isMissing ? { frame, arrived } : null;
    if (isMissing) this._ask();
    return graph;
  }

  /** Forget everything. */
  clear() {
    this._known.clear();
  }

  async _ask() {
    if (this._asking || this._wanted === null) return;
    this._asking = true;
    const { frame, arrived } = this._wanted;
    this._wanted = null;
    try {
      const graph = await this._fetch(frame.tick);
      this._known.set(graph.id, graph);
      if (this._known.size > KEPT) this._known.delete(this._known.keys().next().value);
      arrived(graph);
    } catch {
      // Whoever wants it next asks again.
    } finally {
      this._asking = false;
    }
    this._ask();
  }
}

// What a tick taught: how many implications are new since the tick before, and how many are
// gone. It follows from the two ticks alone, and a click compares them.

/** The button in the head of the diagram. */
export class OrderChanges {
  /** @param {(tick: number, other: string, then: number) => Promise<object>} fetchDifference */
  constructor(fetchDifference) {
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
        const found = await this._fetch(tick, run, tick - 1);
        if (this._tick === tick) this._say(found);
      } catch {
        // The tick before cannot be known: then there is nothing to say.
      }
    }
    this._asking = false;
  }

  _say({ tick, here, there }) {
    const [more, fewer] = [here, there].map(({ count }) => count);
    this._button.hidden = more + fewer === 0;
    const parts = [more ? `+${more}` : "", fewer ? `−${fewer}` : ""].filter(Boolean);
    write(this._button, `${parts.join(" ")} at this tick`);
    const words = `${counted(more, "implication")} more and ${fewer} fewer than at tick ${tick - 1}: compare`;
    this._button.title = words;
  }
}
