// How the environment drew itself: the last image at the tick one is at, or before.

import { at } from "../base/api.js";
import { find, write } from "../base/dom.js";

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
    this._image.src = at("image", { tick: image });
    this._image.alt = `The environment at tick ${image}, as it draws itself.`;
    write(find("image-tick"), `tick ${image}`);
  }
}
