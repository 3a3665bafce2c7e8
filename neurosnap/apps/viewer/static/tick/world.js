// The world itself, where it can be drawn: a path, a cycle, a grid with the target, or a
// map with what is in it.

import { find, shape } from "../base/dom.js";
import { arrowTo, holesOf, isWay, signOf, tileAt, wallBetween } from "./tiles.js";

const isFlat = ({ kind }) => kind === "grid" || kind === "map";

/** Where a point is drawn, its y upwards. */
const above = ({ height }, [x, y]) => [x + 0.5, height - 0.5 - y];

/** Where each place is drawn, a place being one wide. */
function spots(stage) {
  if (isFlat(stage)) return stage.coordinates.map((point) => above(stage, point));
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
    this._spots.forEach(([x, y], place) => {
      const square = { x: x - 0.46, y: y - 0.46, width: 0.92, height: 0.92, rx: 0.12 };
      const plain = () => [shape("rect", { ...square, class: "place" })];
      const tile = stage.tiles[place];
      this._drawing.append(...(tile === undefined ? plain() : tileAt([x, y], tile)));
    });
    if (stage.kind === "grid") {
      const holes = holesOf(stage).flatMap((point) => tileAt(above(stage, point), "hole"));
      this._drawing.append(...holes);
    }
    for (const [a, b] of stage.walls) {
      this._drawing.append(wallBetween(this._spots[a], this._spots[b]));
    }
    if (stage.target !== null) {
      const [cx, cy] = this._spots[stage.target];
      for (const r of [0.36, 0.14]) {
        this._drawing.append(shape("circle", { cx, cy, r, class: "target" }));
      }
    }
    this._moving = shape("g");
    this._drawing.append(this._moving);
    find("world-drawing").replaceChildren(this._drawing);
  }

  /** Show where the world is at a tick, and in what state. */
  show({ place, heading, things }) {
    if (this._stage === null) return;
    const here = place === null ? null : this._spots[place];
    const placed = things.filter((thing) => thing.place !== null || here !== null);
    const under = placed.filter((thing) => thing.place !== null);
    const carried = placed.filter((thing) => thing.place === null);
    this._moving.replaceChildren(
      ...under.map((thing) => signOf(thing, this._spots[thing.place])),
      ...(here === null ? [] : [this._agentAt(here, heading)]),
      ...carried.map((thing) => signOf(thing, here)),
    );
    this._drawing.setAttribute("aria-label", this._words(place, heading, things));
  }

  _agentAt([cx, cy], heading) {
    const isMap = this._stage.tiles.length > 0; // it goes beside the letter of its tile
    const round = isMap ? { r: 0.26, transform: "translate(0.1 0.12)" } : { r: 0.3 };
    if (!isWay(heading)) return shape("circle", { cx, cy, ...round, class: "agent" });
    return shape("path", { ...arrowTo(heading, [cx, cy]), class: "agent" });
  }

  _words(place, heading, things) {
    const { kind, places, target } = this._stage;
    const where = place === null ? "place not known" : `at ${this._called(place)}`;
    const aim = target === null ? "" : `, target ${this._called(target)}`;
    const facing = heading === "" ? "" : `, facing ${heading}`;
    const others = things.map(({ words }) => `, ${words}`).join("");
    return `A ${kind} of ${places} places: ${where}${aim}${facing}${others}`;
  }

  _called(place) {
    const { kind, coordinates, height, tiles } = this._stage;
    const [x, y] = coordinates[place];
    if (kind === "grid") return `(${x}, ${y})`;
    if (kind === "map") return `row ${height - 1 - y}, column ${x}, ${tiles[place]}`;
    return `place ${place}`;
  }
}
