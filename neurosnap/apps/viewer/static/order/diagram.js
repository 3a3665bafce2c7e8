// The diagram: the learned order in layers, the state in its nodes, and moving waves.
// Nothing is laid out again while the order is the same.

import { keep, shape } from "../base/dom.js";
import { drawn } from "../base/literals.js";
import { MOST, restricted } from "./focus.js";
import { drawingOf, layOut } from "./layered_drawing.js";
import { endsOf, lineOf, marksOf, pulsesOf, stripesOf, tiesOf } from "./lines.js";
import { dress, looks, nodeOf, widthOf } from "./nodes.js";

const [SMALLEST, LARGEST] = [0.02, 4]; // scales
const MARGIN = 14;
const NUMBERS = 20; // room beside the drawing, where the layers are numbered
const STILL = 4; // pixels within which a press is a click
const HATCH = "M-1 1L1 -1M0 6L6 0M5 7L7 5";

/** A learned order, drawn into an element. */
export class Diagram {
  /**
   * @param {HTMLElement} home what it fills
   * @param {object} on
   * @param {(thing: object|null) => void} on.pick told what was clicked: `{sensor}`,
   *   `{edge}` or null
   * @param {() => void} on.alone told to lay out only what is looked at
   * @param {(sensor: number) => string} on.tell what to say of a sensor under the pointer
   */
  constructor(home, on) {
    this._home = home;
    this._on = on;
    this._camera = { x: 0, y: 0, scale: 1 }; // the place in the middle, and how large it is
    this._whole = true; // the camera sees everything, and keeps doing so
    this._graph = null;
    this._seen = null; // the part of it that is laid out
    this._focus = { sensors: null, edges: new Set(["excite", "inhibit", "same"]), alone: false };
    this._laid = layOut([], [], widthOf);
    this._lines = [];
    this._nodes = new Map(); // by sensor
    this._frame = null;
    this._wave = null;
    this._chosen = null;
    this._sought = null;
    this._marks = { sensors: [], rules: [] };
    const hatch = shape("pattern", { id: "hatch", width: 6, height: 6, patternUnits: "userSpaceOnUse" });
    hatch.append(shape("path", { class: "hatch", d: HATCH }));
    this._layers = ["stripes", "ties", "links", "nodes", "marks", "pulses"].map((name) => shape("g", { class: name }));
    this._view = shape("g");
    this._view.append(hatch, ...endsOf(), ...this._layers);
    // Its own middle is that of the element: what is seen there stays there at every size.
    const middle = shape("svg", { x: "50%", y: "50%", overflow: "visible" });
    middle.append(this._view);
    this._picture = shape("svg", { "aria-hidden": true });
    this._picture.append(middle);
    home.append(this._picture);
    new ResizeObserver(() => this._whole && this.fit()).observe(home);
    this._listen(home);
  }

  /** How many sensors are laid out, and how many there would be if there were room. */
  get count() {
    return { items: this._nodes.size, sensors: this._seen?.nodes.length ?? 0 };
  }

  /**
   * Show a tick.
   *
   * @param {object|null} graph the order; null if none is known yet
   * @param {object} frame
   * @param {object|null} wave what of a wave to show instead of the state: `hops`, the
   *   hops of each literal it reaches, and `at`, how many it has gone, with fractions
   */
  show(graph, frame, wave) {
    this._frame = frame;
    this._wave = wave;
    if (graph !== null && graph.id !== this._graph?.id) {
      this._graph = graph;
      this._arrange();
    } else {
      this._dressNodes();
    }
  }

  /** Mark what is wrong: `sensors` at fault, and `rules` that are broken. */
  mark(marks) {
    this._marks = marks;
    this._layers[4].replaceChildren(...marksOf(marks, this._laid.places));
  }

  /**
   * Show what is looked at, as `Focus.of` has it; the rest is faint or left out. Mark what is
   * selected, `{sensor}`, `{edge}` or null, and the sensors a search has found, null if
   * there is no search.
   */
  focus(focus, chosen, sought) {
    const key = ({ sensors, edges, alone, most }) => [alone, most, [...edges], [...(sensors ?? ["all"])]].join();
    const laidOut = this._focus.alone || focus.alone;
    const same = key(focus) === key(this._focus);
    const isMarked = chosen === this._chosen && sought === this._sought;
    this._focus = { ...focus, edges: new Set(focus.edges) };
    [this._chosen, this._sought] = [chosen, sought];
    if ((same && isMarked) || this._graph === null) return;
    if (laidOut && !same) {
      this._whole = true;
      this._arrange();
    } else {
      this._dress();
    }
  }

  // Looking --------------------------------------------------------------------------

  /** Bring a sensor into view. */
  reveal(sensor) {
    const node = this._nodes.get(sensor);
    if (node === undefined) return; // it is not read, or not drawn
    const [seen, home] = [node.getBoundingClientRect(), this._home.getBoundingClientRect()];
    const isInside = seen.left >= home.left && seen.right <= home.right;
    const isBetween = seen.top >= home.top && seen.bottom <= home.bottom;
    if (isInside && isBetween && this._camera.scale >= 0.5) return;
    const { x, y } = this._laid.places.get(sensor);
    this.look({ x, y, scale: Math.max(this._camera.scale, 0.8) });
  }

  /** Make everything larger by a factor, around a place that stays where it is. */
  zoom(factor, place = this._camera) {
    const { x, y } = this._camera;
    const scale = Math.min(Math.max(this._camera.scale * factor, SMALLEST), LARGEST);
    const by = this._camera.scale / scale;
    this.look({ x: place.x + (x - place.x) * by, y: place.y + (y - place.y) * by, scale });
  }

  /** Look at a place, `x` and `y`, at a scale, and stay there. */
  look(camera) {
    this._whole = false;
    this._aim(camera);
  }

  /** See everything, at not much more than its own size, or more where there is much room. */
  fit() {
    const { left, right, top, bottom } = this._laid.box;
    const { clientWidth: width, clientHeight: height } = this._home;
    const across = (width - 2 * MARGIN) / (right - left + NUMBERS);
    const down = (height - 2 * MARGIN) / (bottom - top);
    const scale = Math.max(Math.min(across, down, Math.max(1.25, width / 1300)), SMALLEST);
    this._aim({ x: (left - NUMBERS + right) / 2, y: (top + bottom) / 2, scale });
    this._whole = true;
  }

  _aim(camera) {
    this._camera = camera;
    const { x, y, scale } = camera;
    this._view.setAttribute("transform", `scale(${scale}) translate(${-x} ${-y})`);
    this._picture.classList.toggle("far", scale < 0.5); // a name is only grey noise
  }

  // Drawing --------------------------------------------------------------------------

  _arrange() {
    this._seen = this._focus.alone ? restricted(this._graph, this._focus) : this._graph;
    const isLegible = this._seen.nodes.length <= MOST;
    const { items, links } = isLegible ? drawingOf(this._seen) : { items: [], links: [] };
    this._laid = layOut(items, links, widthOf);
    const { places, bands, box } = this._laid;
    this._draw(links);
    this._nodes = new Map([...places].map(([sensor, place]) => [sensor, nodeOf(place, this._nodes.get(sensor))]));
    const [stripes, , lines, nodes] = this._layers;
    stripes.replaceChildren(...stripesOf(bands, box.left - NUMBERS));
    keep(lines, this._lines.map(({ line }) => line));
    keep(nodes, [...this._nodes.values()]);
    this._layers[4].replaceChildren(...marksOf(this._marks, places));
    if (this._whole) this.fit();
    this._dress();
  }

  /** Draw lines and ties where they belong, as wide as they were tested. */
  _draw(links) {
    const { places } = this._laid;
    // What was there before moves: to make and style hundreds of elements takes a frame.
    const before = new Map(this._lines.map((line) => [line.line.dataset.edge, line]));
    this._lines = links.map((link) => lineOf(link, places, before));
    this._layers[1].replaceChildren(...tiesOf(places));
  }

  /** Take over how often the relations of the order that is shown were tested. */
  weigh(graph) {
    this._graph = graph;
    if (this._nodes.size === 0) return;
    const { items, links } = drawingOf(this._focus.alone ? restricted(graph, this._focus) : graph);
    for (const item of items) this._laid.places.get(item.sensor).item = item;
    this._draw(links);
    this._dress();
  }

  /** Mark what is selected, found and looked at. */
  _dress() {
    this._layers[1].toggleAttribute("hidden", !this._focus.edges.has("same"));
    for (const { link, line } of this._lines) line.setAttribute("class", this._lookOf(link));
    this._dressNodes();
  }

  _dressNodes() {
    if (this._frame === null) return;
    const lookOf = looks(this._frame, this._wave, this._chosen, this._sought, this._focus.sensors);
    for (const [sensor, node] of this._nodes) dress(node, lookOf(this._laid.places.get(sensor).item));
    const pulses = this._layers.at(-1);
    if (this._wave) pulses.replaceChildren(...pulsesOf(this._lines, this._wave));
    else if (pulses.firstChild) pulses.replaceChildren();
  }

  /** How a line looks, as the classes of its element. */
  _lookOf({ from, to, edge, kind, tested }) {
    const { sensors, edges, most } = this._focus;
    const { sensor, edge: chosen } = this._chosen ?? {};
    const ends = [from.sensor, to.sensor];
    const isChosen = chosen ? chosen.source === edge.source && chosen.target === edge.target : ends.includes(sensor);
    const isFar = sensors !== null && !ends.every((end) => sensors.has(end));
    const isFaint = isFar || (this._sought !== null && !ends.some((end) => this._sought.has(end)));
    return [`link ${kind}`, tested === 0 && "untested", (!edges.has(kind) || tested > most) && "gone", isChosen ? "chosen" : isFaint && "faint"].filter(Boolean).join(" ");
  }

  // The pointer: dragging moves the drawing, the wheel makes it larger, a click means what
  // is under it.

  _listen(home) {
    let held = null;
    home.addEventListener("pointerdown", ({ button, clientX: x, clientY: y, pointerId, target }) => {
      if (button !== 0) return;
      held = { x, y, target, moved: false };
      home.setPointerCapture(pointerId);
    });
    home.addEventListener("pointermove", ({ clientX: x, clientY: y, target }) => {
      if (held === null) {
        this._over(thingAt(target));
        return;
      }
      const [across, down] = [x - held.x, y - held.y];
      if (!held.moved && Math.hypot(across, down) < STILL) return;
      const { x: atX, y: atY, scale } = this._camera;
      this.look({ x: atX - across / scale, y: atY - down / scale, scale });
      held = { x, y, moved: true };
    });
    home.addEventListener("pointerup", () => {
      if (held !== null && !held.moved) this._on.pick(thingAt(held.target));
      held = null;
    });
    home.addEventListener("pointercancel", () => (held = null));
    home.addEventListener("dblclick", ({ clientX, clientY }) => {
      const thing = thingAt(document.elementFromPoint(clientX, clientY));
      if (thing?.sensor === undefined) this.fit();
      else this._on.alone();
    });
    const onWheel = (event) => {
      event.preventDefault(); // the page itself does not scroll
      const { left, top, width, height } = home.getBoundingClientRect();
      const { x, y, scale } = this._camera;
      const [across, down] = [event.clientX - left - width / 2, event.clientY - top - height / 2];
      this.zoom(Math.exp(-event.deltaY / 400), { x: x + across / scale, y: y + down / scale });
    };
    home.addEventListener("wheel", onWheel, { passive: false });
  }

  /** Say what is under the pointer, which may be too small to read. */
  _over(thing) {
    const said = thing?.sensor === undefined ? "" : this._on.tell(thing.sensor);
    if (this._home.title !== said) this._home.title = said;
  }
}

/** What an element of the drawing stands for: `{sensor}`, `{edge}`, or null. */
function thingAt(element) {
  const { sensor, edge } = element?.closest("[data-sensor], [data-edge]")?.dataset ?? {};
  if (sensor !== undefined) return { sensor: Number(sensor) };
  return edge === undefined ? null : { edge: drawn(...edge.split("-").map(Number)) };
}
