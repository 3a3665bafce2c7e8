// Why a wave of a tick goes nowhere, and which other one goes deep.

import { counted } from "../base/dom.js";

/** The wave that goes deepest, of those that start in the present state if any of them does. */
export function deepest(waves) {
  const deep = waves.filter(({ depth }) => depth > 0);
  const here = deep.filter(({ imagined }) => !imagined);
  const offered = here.length > 0 ? here : deep;
  return offered.reduce((best, wave) => (wave.depth > (best?.depth ?? 0) ? wave : best), null);
}

/** Why a state wave has depth 0; empty: it has more, or it is no state wave. */
export function whyShallow(frame, wave) {
  if (wave === null || wave.kind !== "state" || wave.depth > 0 || !wave.settled) return "";
  const isRead = (_, sensor) => sensor < frame.sensors && !frame.retired.includes(sensor);
  const bits = frame.bits.filter(isRead);
  const unread = bits.filter((bit) => bit === null).length;
  if (unread === 0) return `All ${counted(bits.length, "sensor")} were read: nothing to infer.`;
  const missing = `${counted(unread, "sensor")} ${unread === 1 ? "was" : "were"} not read`;
  return `${missing}, and no reading implies anything of ${unread === 1 ? "it" : "them"}.`;
}
