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
