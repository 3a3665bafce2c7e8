// The diagram: the learned order in layers, the state in its nodes, and a wave on its way
// over them. Nothing is laid out again while the order is the same.

import { Camera } from "./camera.js";
import { restricted } from "./focus.js";
import { Glide } from "./glide.js";
import { collapse, MOST } from "./groups.js";
import { Layers } from "./layers.js";
import { layOut, HEIGHT } from "./layout.js";
import { curve, distance } from "./links.js";
import { NodePainter, widthOf } from "./nodes.js";
import { paintLines, paintNodes, paintWave } from "./painting.js";
import { point } from "./pointer.js";
import { waysOf } from "./pulses.js";

const NEAR = 7; // pixels from a line that still mean it

/** A learned order, drawn into an element. */
export class Diagram {
  /**
   * @param {HTMLElement} home what it fills
   * @param {object} on
   * @param {(thing: object|null) => void} on.pick told what was clicked: `{sensor}`,
   *   `{edge}` or null
   * @param {() => void} on.alone told to lay out only what is looked at
   * @param {() => void} on.change told when something was expanded or collapsed
   * @param {() => void} on.aim told when one looks elsewhere
   * @param {(item: object) => string} on.tell what to say of an item under the pointer
   */
  constructor(home, on) {
    this._on = on;
    this._layers = new Layers(home);
    this._camera = new Camera();
    this._painter = new NodePainter();
    this._graph = null;
    this._seen = null; // the part of it that is laid out
    this._focus = { sensors: null, edges: new Set(["excite", "inhibit", "same"]), alone: false };
    this._expanded = new Set();
    this._all = false;
    this._drawing = { items: [], links: [], itemOf: [] };
    this._laid = layOut([], [], widthOf); // where items stand
    this._places = this._laid.places; // where they are drawn: on their way, for a moment
    this._curves = new Map();
    this._glide = new Glide((places) => this._draw(places));
    this._ways = [];
    this._frame = null;
    this._wave = null;
    this._chosen = null;
    this._sought = null;
    this._shown = new Map(); // how each item was painted last
    this._whole = true; // the camera sees everything, and keeps doing so
    new ResizeObserver(() => this._resize()).observe(home);
    point(home, {
      move: (across, down) => this._aim((camera) => camera.move(across, down)),
      zoom: (factor, x, y) => this._aim((camera) => camera.zoom(factor, x, y)),
      click: (x, y) => this._click(this._at(x, y)),
      over: (x, y) => this._over(home, this._at(x, y)),
    });
    home.addEventListener("dblclick", ({ offsetX, offsetY }) => {
      const at = this._at(offsetX, offsetY);
      if (at?.item?.kind === "sensor") on.alone();
      else this.fit();
    });
  }

  /** How many items are drawn, of how many sensors. */
  get count() {
    return { items: this._drawing.items.length, sensors: this._seen?.nodes.length ?? 0 };
  }

  /** All that is painted. @returns {import("./painting.js").Scene} */
  get scene() {
    return {
      bands: this._laid.bands,
      places: this._places,
      curves: this._curves,
      ways: this._ways,
      frame: this._frame,
      wave: this._wave,
      chosen: this._chosen,
      sought: this._sought,
      focus: this._focus,
    };
  }

  /** What it takes up, in places of the drawing. */
  get box() {
    return this._laid.box;
  }

  /** Whether there is too much to draw every sensor by itself. */
  get isLarge() {
    return this.count.sensors > MOST;
  }

  /**
   * Show a tick.
   *
   * @param {object|null} graph the order; null: none is known yet
   * @param {object} frame
   * @param {object|null} wave what of a wave to show instead of the state: `hops`, the
   *   hops of each literal it reaches, and `at`, how many it has gone, with fractions
   * @param {boolean} glides whether what moves is seen to move: there is time for it
   */
  show(graph, frame, wave, glides = true) {
    const moving = wave !== null || this._wave !== null;
    this._frame = frame;
    this._wave = wave;
    if (graph !== null && graph.id !== this._graph?.id) {
      this._graph = graph;
      this._arrange(glides);
      return;
    }
    this._paintNodes();
    if (moving) this._paintPulses();
  }

  /** Mark what is selected: `{sensor}`, `{edge}`, or null. */
  choose(thing) {
    this._chosen = thing;
    this._paint();
  }

  /** Show what is looked at, as `Focus.of` has it; the rest is faint or left out. */
  focus(focus) {
    const key = ({ sensors, edges, alone }) => [alone, [...edges], [...(sensors ?? ["all"])]].join();
    const laidOut = this._focus.alone || focus.alone;
    const same = key(focus) === key(this._focus);
    this._focus = { ...focus, edges: new Set(focus.edges) };
    if (same || this._graph === null) return;
    if (!laidOut) {
      this._paint();
      return;
    }
    this._whole = true;
    this._arrange();
  }

  /** Mark the sensors a search has found; null: there is no search. */
  seek(sensors) {
    this._sought = sensors;
    this._paint();
  }

  /** Bring a sensor into view, out of what it is collapsed into. */
  reveal(sensor) {
    if (this._graph === null) return;
    let item = this._drawing.itemOf[sensor];
    if (item === undefined) return; // it is not read
    while (item.kind !== "sensor") {
      this._expand(item);
      item = this._drawing.itemOf[sensor];
    }
    const place = this._laid.places.get(item.key);
    const { width, height } = this._layers;
    if (this._camera.sees(place, width, height)) return;
    this._aim((camera) => camera.centre(place, width, height));
  }

  /** Draw every sensor by itself, or collapse again what is too much. */
  expandAll(all) {
    this._all = all;
    this._expanded.clear();
    this._whole = true;
    this._arrange();
    this._on.change();
  }

  /** Make everything larger by a factor. */
  zoom(factor) {
    const { width, height } = this._layers;
    this._aim((camera) => camera.zoom(factor, width / 2, height / 2));
  }

  /** Where one looks: the place in the middle, and the scale; null: at all of it. */
  get view() {
    const { width, height } = this._layers;
    return this._whole ? null : this._camera.view(width, height);
  }

  /** Look there. */
  look(view) {
    const { width, height } = this._layers;
    this._aim((camera) => camera.look(view, width, height));
  }

  /** See everything. */
  fit() {
    if (!this._whole) {
      this._whole = true;
      this._on.aim();
    }
    this._camera.fit(this._laid.box, this._layers.width, this._layers.height);
    this._paint();
  }

  /** The scheme of colours has changed. */
  recolour() {
    this._painter.renew();
    this._paint();
  }

  // Arranging ------------------------------------------------------------------------

  _arrange(glides = true) {
    const from = new Map();
    for (const [key, place] of this._places) from.set(key, this._camera.over(place));
    this._seen = this._focus.alone ? restricted(this._graph, this._focus) : this._graph;
    this._drawing = collapse(this._seen, this._expanded, this._all ? Infinity : MOST);
    const { items, links } = this._drawing;
    this._laid = layOut(items, links, widthOf);
    this._ways = waysOf(links);
    const { width, height } = this._layers;
    if (this._whole) this._camera.fit(this._laid.box, width, height);
    // The camera may have turned: they set out from where they were on the screen.
    for (const [key, place] of from) from.set(key, this._camera.under(place));
    this._glide.start(glides ? from : new Map(), this._laid.places);
  }

  /** Draw items at certain places, and the lines between them. */
  _draw(places) {
    this._places = places;
    this._curves = new Map(this._drawing.links.map((link) => [link, curve(link, places)]));
    this._paint();
  }

  _expand(item) {
    this._expanded.add(item.key);
    this._arrange();
    this._on.change();
  }

  _resize() {
    const { width, height } = this._layers.resize();
    if (this._whole) {
      this.fit();
    } else {
      this._camera.move(width / 2, height / 2); // what is in the middle stays there
      this._paint();
    }
  }

  /** Move the camera by hand; it stays where it was put. */
  _aim(move) {
    this._whole = false;
    move(this._camera);
    this._paint();
    this._on.aim();
  }

  // Painting -------------------------------------------------------------------------

  _paint() {
    this._paintLines();
    this._shown.clear();
    this._layers.wipe(this._layers.nodes);
    this._paintNodes();
    this._paintPulses();
  }

  _paintLines() {
    const { lines } = this._layers;
    this._layers.wipe(lines);
    paintLines(lines, this.scene, this._sheet);
  }

  _paintNodes() {
    if (this._frame === null) return;
    paintNodes(this._layers.nodes, this.scene, this._sheet, this._shown);
  }

  _paintPulses() {
    this._layers.wipe(this._layers.pulses);
    paintWave(this._layers.pulses, this.scene, this._sheet);
  }

  get _sheet() {
    const { width, dots } = this._layers;
    return { camera: this._camera, width, dots, painter: this._painter };
  }

  // Clicking -------------------------------------------------------------------------

  _click(thing) {
    if (thing?.item && thing.item.kind !== "sensor") this._expand(thing.item);
    else if (thing?.item) this._on.pick({ sensor: thing.item.sensors[0] });
    else if (thing?.link.edges.length === 1) this._on.pick({ edge: thing.link.edges[0] });
    else this._on.pick(null);
  }

  /** Name what is under the pointer, which may be too small to read; tell if anything is. */
  _over(home, thing) {
    const name = thing?.item ? this._on.tell(thing.item) : "";
    if (home.title !== name) home.title = name;
    return thing !== null;
  }

  /** What is at a place on the screen: `{item}`, `{link}`, or null. */
  _at(x, y) {
    const under = this._camera.under(x, y);
    for (const place of this._laid.places.values()) {
      const across = Math.abs(under.x - place.x) <= place.width / 2;
      if (across && Math.abs(under.y - place.y) <= HEIGHT / 2) return { item: place.item };
    }
    let [nearest, least] = [null, NEAR / this._camera.scale];
    for (const [link, c] of this._curves) {
      const off = distance(c, under);
      if (off < least) [nearest, least] = [link, off];
    }
    return nearest && { link: nearest };
  }
}
