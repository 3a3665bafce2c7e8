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
