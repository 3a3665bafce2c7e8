// The world itself, where it can be drawn: a path, a cycle, or a grid, with the target.

import { find, shape } from "./dom.js";

/** Where each place is drawn, a place being one wide. */
function spots(stage) {
  if (stage.kind === "grid") {
    return stage.coordinates.map(([x, y]) => [x + 0.5, stage.height - 0.5 - y]);
  }
  if (stage.kind === "path") return stage.coordinates.map(([x]) => [x + 0.5, 0.5]);
  const radius = Math.max(stage.places / (2 * Math.PI), 1) * 1.1;
  return stage.coordinates.map((_, place) => {
    const angle = (2 * Math.PI * place) / stage.places;
    return [radius + 0.5 + radius * Math.sin(angle), radius + 0.5 - radius * Math.cos(angle)];
  });
}

/** The panel of the world. */
export class WorldView {
  /** @param {object|null} stage as the server describes it */
  constructor(stage) {
    this._stage = stage;
    find("world").hidden = stage === null;
    if (stage === null) return;
    this._spots = spots(stage);
    const most = (axis) => Math.max(...this._spots.map((spot) => spot[axis])) + 0.5;
    const box = `-0.1 -0.1 ${most(0) + 0.2} ${most(1) + 0.2}`;
    this._drawing = shape("svg", { viewBox: box, role: "img" });
    for (const [x, y] of this._spots) {
      const square = { x: x - 0.46, y: y - 0.46, width: 0.92, height: 0.92, rx: 0.12 };
      this._drawing.append(shape("rect", { ...square, class: "place" }));
    }
    if (stage.target !== null) {
      const [cx, cy] = this._spots[stage.target];
      for (const r of [0.36, 0.14]) {
        this._drawing.append(shape("circle", { cx, cy, r, class: "target" }));
      }
    }
    this._agent = shape("circle", { r: 0.3, class: "agent", visibility: "hidden" });
    this._drawing.append(this._agent);
    find("world-drawing").replaceChildren(this._drawing);
  }

  /** Show where the world is at a tick. */
  show({ place }) {
    if (this._stage === null) return;
    this._agent.setAttribute("visibility", place === null ? "hidden" : "visible");
    if (place !== null) {
      const [x, y] = this._spots[place];
      this._agent.setAttribute("cx", x);
      this._agent.setAttribute("cy", y);
    }
    this._drawing.setAttribute("aria-label", this._words(place));
  }

  _words(place) {
    const { kind, places, target } = this._stage;
    const where = place === null ? "place not known" : `at ${this._called(place)}`;
    const aim = target === null ? "" : `, target ${this._called(target)}`;
    return `A ${kind} of ${places} places: ${where}${aim}`;
  }

  _called(place) {
    if (this._stage.kind !== "grid") return `place ${place}`;
    return `(${this._stage.coordinates[place].join(", ")})`;
  }
}
