// Buttons, keys, tabs and the address: every way to tell the page what to do.

import { find } from "./dom.js";
import { listen } from "./keys.js";
import { tabs } from "./tabs.js";
import { theme } from "./theme.js";

/** The tick in the address; null if there is none. */
export function tickAsked() {
  const found = /^#t=(\d+)$/.exec(location.hash);
  return found && Number(found[1]);
}

/** Let a page be told what to do. */
export function bind(page) {
  const { player, diagram } = page;
  const toggleTheme = theme(() => page.recolour());
  const toggleTaller = () => {
    const tall = find("taller").closest("main").classList.toggle("tall");
    find("taller").setAttribute("aria-pressed", tall);
  };
  const help = () => find("keys").showModal();
  const acts = [
    ["fit", () => diagram.fit()],
    ["nearer", () => diagram.zoom(1.3)],
    ["farther", () => diagram.zoom(1 / 1.3)],
    ["expand", () => page.expand()],
    ["taller", toggleTaller],
    ["help", help],
  ];
  for (const [id, act] of acts) find(id).addEventListener("click", act);
  tabs(document.querySelector('[role="tablist"]'), (panel) => page.open(panel));
  addEventListener("hashchange", () => {
    const tick = tickAsked();
    if (tick !== null && tick !== player.tick) player.step(tick - player.tick);
  });
  listen([
    { keys: [" "], says: "play, or pause", act: () => player.toggle() },
    { keys: ["ArrowLeft"], says: "one tick back", act: () => player.step(-1) },
    { keys: ["ArrowRight"], says: "one tick on", act: () => player.step(1) },
    { keys: ["Shift+ArrowLeft"], says: "ten ticks back", act: () => player.step(-10) },
    { keys: ["Shift+ArrowRight"], says: "ten ticks on", act: () => player.step(10) },
    { keys: ["Home"], says: "the first tick", act: () => player.step(-Infinity) },
    { keys: ["End"], says: "the last tick", act: () => player.step(Infinity) },
    { keys: ["w"], says: "play the wave of this tick", act: () => page.wave.toggle() },
    { keys: ["/"], says: "find a sensor", act: () => page.search.focus() },
    { keys: ["+"], says: "larger", act: () => diagram.zoom(1.3) },
    { keys: ["-"], says: "smaller", act: () => diagram.zoom(1 / 1.3) },
    { keys: ["0"], says: "see the whole order", act: () => diagram.fit() },
    { keys: ["t"], says: "more room for plots and tables", act: toggleTaller },
    { keys: ["l"], says: "light or dark", act: toggleTheme },
    { keys: ["Escape"], says: "select nothing", act: () => page.choose(null) },
    { keys: ["?"], says: "these keys", act: help },
  ]);
}
