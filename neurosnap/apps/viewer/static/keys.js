// Controls of the page: buttons, tabs, the address and the keyboard.
// Everything that is done often has a key, and one of them lists the rest.

import { keep, keepSoon, tickAsked, told } from "./base/address.js";
import { find, flash, make, tabs } from "./base/dom.js";

const TYPED = 'input:not([type="range"]), select, textarea, dialog[open]';
const MOVES = /^(Arrow\w+|Home|End)$/;

/** Let a page be told what to do. */
export function bind(page) {
  const { player, range } = page.time;
  const { diagram } = page.order;
  const toggleTaller = () => {
    const tall = find("taller").closest("main").classList.toggle("tall");
    find("taller").setAttribute("aria-pressed", tall);
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => page.recolour());
  const help = () => find("keys").showModal();
  const acts = [
    ["fit", () => diagram.fit()],
    ["nearer", () => diagram.zoom(1.3)],
    ["farther", () => diagram.zoom(1 / 1.3)],
    ["taller", toggleTaller],
    ["help", help],
    ["range-compare", () => page.compareRange()],
    ["anomaly-back", () => page.toAnomaly(-1)],
    ["anomaly-on", () => page.toAnomaly(1)],
  ];
  for (const [id, act] of acts) find(id).addEventListener("click", act);
  tabs(
    document.querySelector('[role="tablist"]'),
    (panel) => {
      page.open(panel);
      if (page.panels > 1) keepSoon({ tab: panel === page.home ? null : panel }); // else it is the link's
    },
    told().get("tab") ?? page.home,
  );
  find("link").addEventListener("click", () => copyLink(page));
  addEventListener("hashchange", () => {
    const tick = tickAsked();
    if (tick !== null && tick !== player.tick) player.step(tick - player.tick);
    range.restore();
    page.restore();
  });
  listen([
    { keys: [" "], says: "play, or pause", act: () => player.toggle() },
    { keys: ["ArrowLeft"], says: "one tick back", act: () => player.step(-1) },
    { keys: ["ArrowRight"], says: "one tick on", act: () => player.step(1) },
    { keys: ["Shift+ArrowLeft"], says: "ten ticks back", act: () => player.step(-10) },
    { keys: ["Shift+ArrowRight"], says: "ten ticks on", act: () => player.step(10) },
    { keys: ["Home"], says: "the first tick", act: () => player.step(-Infinity) },
    { keys: ["End"], says: "the last tick", act: () => player.step(Infinity) },
    { keys: ["n"], says: "the next anomaly or alarm", act: () => page.toAnomaly(1) },
    { keys: ["p"], says: "the anomaly or alarm before", act: () => page.toAnomaly(-1) },
    { keys: ["["], says: "look at a range that begins here", act: () => range.setEnd(0, player.tick) },
    { keys: ["]"], says: "let the range end here", act: () => range.setEnd(1, player.tick) },
    { keys: ["x"], says: "look at all ticks again", act: () => range.set(null) },
    { keys: ["w"], says: "play the wave of this tick", act: () => page.wave.toggle() },
    { keys: ["/"], says: "find a sensor", act: () => page.order.search.focus() },
    { keys: ["+"], says: "larger", act: () => diagram.zoom(1.3) },
    { keys: ["-"], says: "smaller", act: () => diagram.zoom(1 / 1.3) },
    { keys: ["f"], says: "lay out only what is looked at, or all", act: () => page.order.focus.toggle() },
    { keys: ["0"], says: "see the whole order", act: () => diagram.fit() },
    { keys: ["t"], says: "more room for plots and tables", act: toggleTaller },
    { keys: ["Escape"], says: "select nothing", act: () => page.choose(null) },
    { keys: ["?"], says: "this help", act: help },
  ]);
}

/** Copy the address of what is shown: it holds no token. */
async function copyLink({ time, voice }) {
  keep({ t: time.player.tick });
  try {
    await navigator.clipboard.writeText(location.href);
    voice.tell("link copied");
    flash(find("link"), "Copied");
  } catch {
    flash(find("link"), "In the address bar"); // the browser does not let it be copied
  }
}

/**
 * Listen to keys.
 *
 * @param {{keys: string[], says: string, act: () => void}[]} bindings each with the keys
 *   as the browser calls them; a shifted arrow is "Shift+ArrowLeft"
 */
function listen(bindings) {
  const acts = new Map(bindings.flatMap(({ keys, act }) => keys.map((key) => [key, act])));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const at = event.target;
    if (at.closest(TYPED)) return;
    // A button has its own idea of the space bar, and another slider of where to go.
    if (event.key === " " && at.closest("button, summary")) return;
    if (MOVES.test(event.key) && at.matches('input[type="range"]:not(#time)')) return;
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
