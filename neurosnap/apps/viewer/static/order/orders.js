// A cache of learned orders by id: each is fetched once, one request at a time.
// It fetches for the tick that is wanted now. While it plays and learns, an answer is of a tick
// that has passed: it is handed on all the same, being nearer than what was there before.

import { ask } from "../base/api.js";

const KEPT = 60;

/** Graphs by id. */
export class Orders {
  constructor() {
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
      const graph = await ask("graph", { tick: frame.tick });
      this._known.set(graph.id, graph);
      if (this._known.size > KEPT) this._known.delete(this._known.keys().next().value);
      arrived(graph);
    } catch {
      // The next that wants it asks again.
    } finally {
      this._asking = false;
    }
    this._ask();
  }
}
