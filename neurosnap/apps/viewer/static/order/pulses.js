// Pulses between one hop of a wave and the next, on their way along the lines: round ones
// excite, square ones inhibit.

import { along } from "./links.js";
import { complementOf, isComplement } from "../base/literals.js";

/** Return every way a pulse can go; an edge's contrapositive runs against its line. */
export function waysOf(links) {
  return links.flatMap((link) =>
    link.edges.flatMap(({ source, target }) => [
      { link, source, target, back: false },
      { link, source: complementOf(target), target: complementOf(source), back: true },
    ]),
  );
}

/** Paint the pulses that lead to what a wave reaches with its next hop. */
export function paintPulses(context, ways, curves, { hops, at }, colours) {
  const [now, gone] = [Math.floor(at), at % 1];
  context.lineWidth = 1.5;
  context.strokeStyle = colours["on-wave"];
  context.fillStyle = colours.wave;
  for (const { link, source, target, back } of ways) {
    if (hops.get(source) !== now || hops.get(target) !== now + 1) continue;
    const { x, y } = along(curves.get(link), back ? 1 - gone : gone);
    context.beginPath();
    if (isComplement(target)) context.rect(x - 4, y - 4, 8, 8);
    else context.arc(x, y, 4.5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
}
