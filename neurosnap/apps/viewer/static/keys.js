// Controls of the page: buttons, tabs, the address and the keyboard.
// Everything that is done often has a key, and one of them lists the rest.

import { keep, keepSoon, tickAsked, told } from "./base/address.js";
import { find, flash, make, tabs } from "./base/dom.js";

const TYPED = 'input:not([type="range"]), select, textarea, dialog[open]';
const MOVES = /^(Arrow\w+|Home|End)$/;

/** Let a page be told what to do. */
export function bind(page) {
  const { player, range } = page.time;
  const { diagram, focus } = page.order;
  tabs(
    document.querySelector('[role="tablist"]'),
    (panel) => {
      page.open(panel);
      if (page.panels > 1) keepSoon({ tab: panel === page.home ? null : panel }); // else it is the link's
    },
    told().get("tab") ?? page.home,
  );
  find("link").addEventListener("click", () => copyLink(page));
  find("goto-list").addEventListener("beforetoggle", ({ newState }) => newState === "open" && page.offerTicks());
  find("range-compare").addEventListener("click", () => page.compareRange());
  addEventListener("hashchange", () => {
    const tick = tickAsked();
    if (tick !== null && tick !== player.tick) player.step(tick - player.tick);
    range.restore();
    page.restore();
  });
  listen([
    { key: " ", id: "play", says: "play, or pause", act: () => player.toggle() },
    { key: "ArrowLeft", id: "back", says: "one tick back", act: () => player.step(-1) },
    { key: "ArrowRight", id: "on", says: "one tick on", act: () => player.step(1) },
    { key: "Shift+ArrowLeft", says: "ten ticks back", act: () => player.step(-10) },
    { key: "Shift+ArrowRight", says: "ten ticks on", act: () => player.step(10) },
    { key: "Home", id: "start", says: "the first tick", act: () => player.step(-Infinity) },
    { key: "End", id: "end", says: "the last tick", act: () => player.step(Infinity) },
    { key: "n", id: "anomaly-on", says: "the next anomaly or alarm", act: () => page.toAnomaly(1) },
    { key: "p", id: "anomaly-back", says: "the anomaly or alarm before", act: () => page.toAnomaly(-1) },
    { key: "g", says: "go to the last finding, a day or a week before", act: () => find("goto").click() },
    { key: "[", says: "look at a range that begins here", act: () => range.setEnd(0, player.tick) },
    { key: "]", says: "let the range end here", act: () => range.setEnd(1, player.tick) },
    { key: "x", id: "range", says: "look at all ticks again", act: () => range.set(null) },
    { key: "w", id: "wave-play", says: "play the wave of this tick", act: () => page.wave.toggle() },
    { key: "/", says: "find a sensor", act: () => page.order.search.focus() },
    { key: "+", id: "nearer", says: "larger", act: () => diagram.zoom(1.3) },
    { key: "-", id: "farther", says: "smaller", act: () => diagram.zoom(1 / 1.3) },
    { key: "f", id: "focus-alone", says: "lay out only what is looked at, or all", act: () => focus.toggle() },
    { key: "0", id: "fit", says: "see the whole order", act: () => diagram.fit() },
    { key: "t", id: "taller", says: "more room for plots and tables", act: toggleTaller },
    { key: "Escape", says: "select nothing", act: () => page.choose(null) },
    { key: "?", id: "help", says: "this help", act: () => find("keys").showModal() },
  ]);
}

function toggleTaller() {
  const tall = find("taller").closest("main").classList.toggle("tall");
  find("taller").setAttribute("aria-pressed", tall);
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
 * Listen to keys, and to the buttons that do the same.
 *
 * @param {{key: string, id?: string, says: string, act: () => void}[]} bindings each with the
 *   key as the browser calls it; a shifted arrow is "Shift+ArrowLeft"; and with its button
 */
function listen(bindings) {
  const acts = new Map(bindings.map(({ key, act }) => [key, act]));
  for (const { id, act } of bindings) if (id) find(id).addEventListener("click", act);
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
  for (const { key, says } of bindings) {
    find("keys-list").append(make("dt", {}, make("kbd", {}, named(key))), make("dd", {}, says));
  }
}
