// The keyboard: everything that is done often has a key, and one of them lists the rest.

import { find, make } from "./dom.js";

const TYPED = 'input:not([type="range"]), select, textarea, dialog[open]';

/**
 * Listen to keys.
 *
 * @param {{keys: string[], says: string, act: () => void}[]} bindings each with the keys
 *   as the browser calls them; a shifted arrow is "Shift+ArrowLeft"
 */
export function listen(bindings) {
  const acts = new Map(bindings.flatMap(({ keys, act }) => keys.map((key) => [key, act])));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const at = event.target;
    if (at.closest(TYPED)) return;
    // A button has its own idea of the space bar, and another slider of arrows.
    if (event.key === " " && at.closest("button")) return;
    if (event.key.startsWith("Arrow") && at.matches('input[type="range"]:not(#time)')) return;
    const shifted = event.shiftKey && event.key.startsWith("Arrow");
    const act = acts.get(shifted ? `Shift+${event.key}` : event.key);
    if (!act) return;
    event.preventDefault();
    act();
  });
  const names = { " ": "Space", ArrowLeft: "←", ArrowRight: "→" };
  const named = (key) =>
    key.replace("Shift+", "Shift ").replace(/Arrow\w+|^ $/, (name) => names[name] ?? name);
  for (const { keys, says } of bindings) {
    const shown = keys.flatMap((key) => [" ", make("kbd", {}, named(key))]);
    find("keys-list").append(make("dt", {}, ...shown), make("dd", {}, says));
  }
}
