// The diagram: the learned order in layers, the state in its nodes, and a wave on its way
// over them. Nothing is laid out again while the order is the same.

import { MOST, restricted } from "./focus.js";
import { drawingOf, HEIGHT, layOut } from "./layered_drawing.js";
import { curve, distance, waysOf } from "./lines.js";
import { NodePainter, widthOf } from "./nodes.js";
import { paintLines, paintNodes, paintWave } from "./painting.js";
import { Camera, Glide, Canvases, point } from "./screen.js";

const NEAR = 7; // pixels from a line that still mean it

/** A learned order, drawn into an element. */
export class Diagram {
  /**
   * @param {HTMLElement} home what it fills
   * @param {object} on
   * @param {(thing: object|null) => void} on.pick told what was clicked: `{sensor}`,
   *   `{edge}` or null
   * @param {() => void} on.alone told to lay out only what is looked at
   * @param {() => void} on.aim told when one looks elsewhere
   * @param {(item: object) => string} on.tell what to say of an item under the pointer
   */
  constructor(home, on) {
    this._on = on;
    this._canvases = new Canvases(home);
    this._camera = new Camera();
    this._painter = new NodePainter();
    this._graph = null;
    this._seen = null; // the part of it that is laid out
    this._focus = { sensors: null, edges: new Set(["excite", "inhibit", "same"]), alone: false };
    this._drawing = { items: [], links: [] };
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
      if (at?.item) on.alone();
      else this.fit();
    });
  }

  /** How many sensors are laid out, and how many there would be if there were room. */
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

  /** Bring a sensor into view. */
  reveal(sensor) {
    const place = this._laid.places.get(sensor);
    if (place === undefined) return; // it is not read, or not drawn
    const { width, height } = this._canvases;
    if (this._camera.sees(place, width, height)) return;
    this._aim((camera) => camera.centre(place, width, height));
  }

  /** Make everything larger by a factor. */
  zoom(factor) {
    const { width, height } = this._canvases;
    this._aim((camera) => camera.zoom(factor, width / 2, height / 2));
  }

  /** Where one looks: the place in the middle, and the scale; null: at all of it. */
  get view() {
    const { width, height } = this._canvases;
    return this._whole ? null : this._camera.view(width, height);
  }

  /** Look there. */
  look(view) {
    const { width, height } = this._canvases;
    this._aim((camera) => camera.look(view, width, height));
  }

  /** See everything. */
  fit() {
    if (!this._whole) {
      this._whole = true;
      this._on.aim();
    }
    this._camera.fit(this._laid.box, this._canvases.width, this._canvases.height);
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
    const isLegible = this._seen.nodes.length <= MOST;
    this._drawing = isLegible ? drawingOf(this._seen) : { items: [], links: [] };
    const { items, links } = this._drawing;
    this._laid = layOut(items, links, widthOf);
    this._ways = waysOf(links);
    const { width, height } = this._canvases;
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

  _resize() {
    const { width, height } = this._canvases.resize();
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
    this._canvases.wipe(this._canvases.nodes);
    this._paintNodes();
    this._paintPulses();
  }

  _paintLines() {
    const { lines } = this._canvases;
    this._canvases.wipe(lines);
    paintLines(lines, this.scene, this._sheet);
  }

  _paintNodes() {
    if (this._frame === null) return;
    paintNodes(this._canvases.nodes, this.scene, this._sheet, this._shown);
  }

  _paintPulses() {
    this._canvases.wipe(this._canvases.pulses);
    paintWave(this._canvases.pulses, this.scene, this._sheet);
  }

  get _sheet() {
    const { width, dots } = this._canvases;
    return { camera: this._camera, width, dots, painter: this._painter };
  }

  // Clicking -------------------------------------------------------------------------

  _click(thing) {
    if (thing?.item) this._on.pick({ sensor: thing.item.sensor });
    else this._on.pick(thing && { edge: thing.link.edge });
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
