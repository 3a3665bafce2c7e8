// Three canvases above each other, so that what changes every tick is all that is painted
// every tick: lines, nodes, pulses.

/** The canvases that fill an element. */
export class Canvases {
  /** @param {HTMLElement} home */
  constructor(home) {
    this._home = home;
    [this.lines, this.nodes, this.pulses] = [0, 1, 2].map(() => {
      const canvas = document.createElement("canvas");
      home.append(canvas);
      return canvas.getContext("2d");
    });
    [this.width, this.height] = [0, 0];
    this.resize();
  }

  /** How many dots of a canvas a pixel of the page has. */
  get dots() {
    return window.devicePixelRatio || 1;
  }

  /** Take the size of the element; what was painted is gone. Returns what was gained. */
  resize() {
    const [width, height] = [this._home.clientWidth, this._home.clientHeight];
    const gained = { width: width - this.width, height: height - this.height };
    [this.width, this.height] = [width, height];
    for (const { canvas } of [this.lines, this.nodes, this.pulses]) {
      canvas.width = Math.round(width * this.dots);
      canvas.height = Math.round(height * this.dots);
    }
    return gained;
  }

  /** Make a canvas empty. */
  wipe(context) {
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, context.canvas.width, context.canvas.height);
  }
}

// Which part of a drawing is seen, and how large.

const [SMALLEST, LARGEST] = [0.02, 4];
const MARGIN = 14;
const FOOT = 20; // the legend stands below

/** Turns places of the drawing into places on the screen: `scale · x + left`. */
export class Camera {
  constructor() {
    this.scale = 1;
    this.left = 0;
    this.top = 0;
  }

  /** See all of a box, at no more than its own size. */
  fit(box, width, height) {
    const across = (width - 2 * MARGIN) / (box.right - box.left);
    const down = (height - FOOT - 2 * MARGIN) / (box.bottom - box.top);
    this.scale = Math.min(Math.max(Math.min(across, down, 1.25), SMALLEST), LARGEST);
    this.left = width / 2 - (this.scale * (box.left + box.right)) / 2;
    this.top = (height - FOOT) / 2 - (this.scale * (box.top + box.bottom)) / 2;
  }

  /** See a place in the middle, not smaller than it can be read. */
  centre({ x, y }, width, height) {
    this.scale = Math.max(this.scale, 0.8);
    this.left = width / 2 - this.scale * x;
    this.top = height / 2 - this.scale * y;
  }

  /** Make everything larger by a factor, around a place on the screen. */
  zoom(factor, x, y) {
    const scale = Math.min(Math.max(this.scale * factor, SMALLEST), LARGEST);
    const by = scale / this.scale;
    this.left = x - (x - this.left) * by;
    this.top = y - (y - this.top) * by;
    this.scale = scale;
  }

  /** The place in the middle of the screen, and how large it is. */
  view(width, height) {
    return { ...this.under(width / 2, height / 2), scale: this.scale };
  }

  /** See a place in the middle, at a scale. */
  look({ x, y, scale }, width, height) {
    this.scale = Math.min(Math.max(scale, SMALLEST), LARGEST);
    this.left = width / 2 - this.scale * x;
    this.top = height / 2 - this.scale * y;
  }

  move(across, down) {
    this.left += across;
    this.top += down;
  }

  /** The place of the drawing under a place on the screen. */
  under(x, y) {
    return { x: (x - this.left) / this.scale, y: (y - this.top) / this.scale };
  }

  /** The place on the screen of a place of the drawing. */
  over({ x, y }) {
    return { x: x * this.scale + this.left, y: y * this.scale + this.top };
  }

  /** Whether an item is to be seen, and read. */
  sees(place, width, height) {
    const { x, y } = this.over(place);
    const reach = (place.width / 2) * this.scale;
    const across = x >= reach && x <= width - reach;
    return across && y >= MARGIN && y <= height - MARGIN && this.scale >= 0.5;
  }
}

// The pointer over a drawing: dragging moves it, the wheel makes it larger, a click means
// what is under it.

const STILL = 4; // pixels within which a press is a click

/**
 * Listen to the pointer.
 *
 * @param {HTMLElement} home
 * @param {object} on
 * @param {(across: number, down: number) => void} on.move
 * @param {(factor: number, x: number, y: number) => void} on.zoom
 * @param {(x: number, y: number) => void} on.click
 * @param {(x: number, y: number) => boolean} on.over whether a click there would do anything
 */
export function point(home, on) {
  let held = null;
  home.addEventListener("pointerdown", ({ button, offsetX: x, offsetY: y, pointerId }) => {
    if (button !== 0) return;
    held = { x, y, moved: false };
    home.setPointerCapture(pointerId);
  });
  home.addEventListener("pointermove", ({ offsetX: x, offsetY: y }) => {
    if (held === null) {
      home.classList.toggle("pointing", on.over(x, y));
      return;
    }
    const [across, down] = [x - held.x, y - held.y];
    if (!held.moved && Math.hypot(across, down) < STILL) return;
    on.move(across, down);
    held = { x, y, moved: true };
  });
  home.addEventListener("pointerup", ({ offsetX: x, offsetY: y }) => {
    if (held !== null && !held.moved) on.click(x, y);
    held = null;
  });
  home.addEventListener("pointercancel", () => {
    held = null;
  });
  const onWheel = (event) => {
    event.preventDefault(); // the page itself does not scroll
    on.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
  };
  home.addEventListener("wheel", onWheel, { passive: false });
}

// Items on their way from where they stood to where they stand now, so that one sees what
// has moved.

const LASTS = 250; // milliseconds
const MOST = 200; // items: more than that would not move smoothly

const still = matchMedia("(prefers-reduced-motion: reduce)");

/** Shows places on their way. */
export class Glide {
  /** @param {(places: Map<string, object>) => void} show told the places of each moment */
  constructor(show) {
    this._show = show;
    this._last = 0; // the frame that is asked for
  }

  /**
   * Let items glide; they are shown where they end, at the latest.
   *
   * @param {Map<string, {x: number, y: number}>} from where they seem to stand
   * @param {Map<string, object>} to where they stand now
   */
  start(from, to) {
    cancelAnimationFrame(this._last);
    const moves = [...to].some(([key, { x, y }]) => {
      const old = from.get(key);
      return old && Math.hypot(old.x - x, old.y - y) > 1;
    });
    if (still.matches || !moves || to.size > MOST) {
      this._show(to);
      return;
    }
    const began = performance.now();
    const step = (now) => {
      const gone = Math.min(1, Math.max(0, now - began) / LASTS);
      if (gone === 1) {
        this._show(to);
        return;
      }
      this._show(between(from, to, gone * gone * (3 - 2 * gone)));
      this._last = requestAnimationFrame(step);
    };
    step(began);
  }
}

/** What was not there before is where it belongs at once. */
function between(from, to, share) {
  const places = new Map();
  for (const [key, place] of to) {
    const old = from.get(key) ?? place;
    const at = (was, is) => was + (is - was) * share;
    places.set(key, { ...place, x: at(old.x, place.x), y: at(old.y, place.y) });
  }
  return places;
}
