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
