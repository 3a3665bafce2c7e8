// The drawing of a world whose places are known: a path, a cycle or a grid.
// What a world draws itself is an image in the recording.

import { at } from "../base/api.js";
import { find, shape, write } from "../base/dom.js";

const HALF = 0.46; // from a place's middle to its side

/** Where each place is drawn, a place being one wide and y going upwards. */
function spots({ kind, places, height, coordinates }) {
  if (kind === "grid") return coordinates.map(([x, y]) => [x + 0.5, height - 0.5 - y]);
  if (kind === "path") return coordinates.map(([x]) => [x + 0.5, 0.5]);
  const radius = Math.max(places / (2 * Math.PI), 1) * 1.1;
  return coordinates.map((_, place) => {
    const angle = (2 * Math.PI * place) / places;
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
      const square = { x: x - HALF, y: y - HALF, width: 2 * HALF, height: 2 * HALF, rx: 0.12 };
      this._drawing.append(shape("rect", { ...square, class: "place" }));
    }
    if (stage.target !== null) {
      const [cx, cy] = this._spots[stage.target];
      for (const r of [0.36, 0.14]) {
        this._drawing.append(shape("circle", { cx, cy, r, class: "target" }));
      }
    }
    this._agent = shape("circle", { r: 0.3, class: "agent" });
    this._plan = shape("g", { class: "plan-steps" });
    this._drawing.append(this._agent, this._plan);
    find("world-drawing").replaceChildren(this._drawing);
  }

  /** Show where the agent is at a tick. */
  show({ place, plan }) {
    if (this._stage === null) return;
    const ways = this._showPlan(place, plan);
    const [x, y] = this._spots[place ?? 0];
    this._agent.setAttribute("visibility", place === null ? "hidden" : "visible");
    this._agent.setAttribute("cx", x);
    this._agent.setAttribute("cy", y);
    const { kind, places, target } = this._stage;
    const where = place === null ? "place not known" : `at ${this._called(place)}`;
    const aim = target === null ? "" : `, target ${this._called(target)}`;
    this._drawing.setAttribute("aria-label", `A ${kind} of ${places} places: ${where}${aim}${ways}`);
  }

  /** Show where each step of a plan leads, as a dot with its number; say it in words. */
  _showPlan(place, plan) {
    const visits = new Map(); // the numbers of the steps, by place
    let at = place;
    for (const [number, step] of (plan?.steps ?? []).entries()) {
      at = this._stage.moves[step]?.[at];
      if (at !== undefined) visits.set(at, [...(visits.get(at) ?? []), number + 1]);
    }
    const dots = [...visits].flatMap(([there, numbers]) => {
      const [x, y] = this._spots[there];
      const text = shape("text", { x, y, "font-size": numbers.length > 1 ? 0.2 : 0.3 });
      write(text, numbers.join(" "));
      return [shape("circle", { cx: x, cy: y, r: 0.21 }), text];
    });
    this._plan.replaceChildren(...dots);
    const why = dots.length ? plan.why : "";
    write(find("world-plan"), why && `The numbers are the steps of the plan: ${why}.`);
    const steps = [...visits].map(([there, numbers]) => `${numbers.join(" and ")} at ${this._called(there)}`);
    return why && `; steps of the plan: ${steps.join(", ")}`;
  }

  _called(place) {
    const { kind, coordinates } = this._stage;
    return kind === "grid" ? `(${coordinates[place].join(", ")})` : `place ${place}`;
  }
}

// How the environment drew itself: the last image at the tick one is at, or before.

/** The panel of the image; not there where the run recorded none. */
export class ImageView {
  constructor({ options }) {
    find("image").hidden = !options.frames;
    this._image = find("image-drawing");
    this._image.addEventListener("error", () => {
      this._image.hidden = true;
      write(find("image-tick"), `the image of tick ${this._tick} cannot be had`);
    });
  }

  /** Show the image for a tick, and say of which tick it is: it may be of one before. */
  show({ image }) {
    if (find("image").hidden || image === this._tick) return;
    this._tick = image;
    this._image.hidden = image === null;
    if (image === null) {
      this._image.removeAttribute("src");
      write(find("image-tick"), "none near this tick was recorded");
      return;
    }
    this._image.src = window.recordedImage?.(image) ?? at("image", { tick: image }); // a file has its own
    this._image.alt = `The environment at tick ${image}, as it draws itself.`;
    write(find("image-tick"), `tick ${image}`);
  }
}
