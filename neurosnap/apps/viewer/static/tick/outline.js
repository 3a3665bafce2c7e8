// The diagram in words: a table with a line for each sensor.

import { find, link, make, table, write } from "../base/dom.js";
import { conditions, drawn, few, isComplement, literalName, readWord, sensorOf } from "../base/literals.js";
import { term } from "../base/terms.js";
import { unread } from "../run/growth.js";

const RARELY = 250; // milliseconds between two updates while it plays
const NAMED = 8; // members of a class that the first of them names

/** The table of sensors. */
export class Outline {
  /**
   * @param {HTMLElement} home
   * @param {string[]} names
   * @param {(sensor: number) => void} pick
   */
  constructor(home, names, pick) {
    this._home = home;
    this._names = names;
    this._rows = names.map((name, sensor) => {
      const open = link(name, () => pick(sensor), "");
      open.title = name; // there may not be room for all of it
      const cells = ["reads", "state", "belief", "layer", "implies"].map((what) => make("td", { className: what }));
      return [open, ...cells];
    });
    const terms = { read: "Reads", state: "State", belief: "Belief", layer: "Layer", implies: "Implies (→), excludes (⊣)" };
    const titles = ["Sensor", ...Object.entries(terms).map(([what, words]) => term(what, words))];
    const caption = "Every sensor, its state and its edges";
    home.replaceChildren(table(caption, titles, this._rows, { id: "outline" }));
    this._shown = 0;
  }

  /** Show a tick; while it plays, now and then. A table that is hidden can wait. */
  show(frame, reasons, playing) {
    const { graph } = reasons;
    const now = performance.now();
    if (this._home.hidden || (playing && now - this._shown < RARELY)) return;
    this._shown = now;
    const words = conditions(frame);
    this._rows.forEach(([open, reads, state, belief], sensor) => {
      const row = open.closest("tr");
      row.hidden = sensor >= frame.sensors;
      if (row.hidden) return;
      const gone = unread(frame, sensor);
      write(reads, gone || readWord(frame, sensor));
      write(state, gone || words[sensor]);
      const kind = reasons.kind(sensor);
      const isPlain = kind === "read" || kind === "unknown" || gone;
      write(belief, isPlain ? kind : `${kind}: ${reasons.of(sensor)}`);
      row.dataset.state = words[sensor];
      row.dataset.belief = kind;
      state.classList.toggle("on", words[sensor] === "on");
    });
    if (graph !== null && graph !== this._graph) this._setGraph(graph);
    find("outline").dataset.tick = frame.tick;
  }

  /** Names have changed. */
  rename() {
    this._graph = null;
    this._rows.forEach(([open], sensor) => {
      write(open, this._names[sensor]);
      open.title = this._names[sensor];
    });
  }

  _setGraph(graph) {
    this._graph = graph;
    for (const [, , , , layer, implies] of this._rows) {
      write(layer, "");
      write(implies, "");
    }
    const out = this._names.map(() => []);
    for (const edge of graph.edges) {
      const { source, target, kind } = drawn(edge.source, edge.target);
      const [from, to] = [source, target].map((end) => literalName(this._names, end));
      const sign = kind === "excite" ? "→" : "⊣";
      const what = kind === "excite" ? to : this._names[sensorOf(target)];
      out[sensorOf(source)].push(isComplement(source) ? `${from} ${sign} ${what}` : `${sign} ${what}`);
      // Two that exclude each other do so both ways.
      if (kind === "inhibit") out[sensorOf(target)].push(`⊣ ${this._names[sensorOf(source)]}`);
    }
    for (const members of graph.classes) {
      // Whatever it has for others it has for each: they name the one that stands for all.
      const [first, ...others] = members.map((literal) => literalName(this._names, literal));
      out[sensorOf(members[0])].push(`${first} ≡ ${few(others, NAMED)}`);
      members.slice(1).forEach((literal, k) => out[sensorOf(literal)].push(`${others[k]} ≡ ${first}`));
    }
    for (const node of graph.nodes) {
      const [, , , , layer, implies] = this._rows[node.sensor];
      write(layer, String(node.layer));
      write(implies, out[node.sensor].join("; "));
    }
  }
}
