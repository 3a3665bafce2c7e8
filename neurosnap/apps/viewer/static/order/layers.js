// Three canvases above each other, so that what changes every tick is all that is painted
// every tick: lines, nodes, pulses.

/** The canvases that fill an element. */
export class Layers {
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
