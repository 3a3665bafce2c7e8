// Light or dark: as the system has it, until somebody says otherwise.

import { find, write } from "./dom.js";

const KEPT = "neurosnap-theme";
const system = matchMedia("(prefers-color-scheme: dark)");

/** Where the browser keeps what was chosen; null: whoever uses it has forbidden that. */
function storage() {
  try {
    return localStorage;
  } catch {
    return null;
  }
}

/** Follow the system, or what was chosen; `changed` is called when it changes. */
export function theme(changed) {
  const root = document.documentElement;
  const chosen = storage()?.getItem(KEPT);
  if (chosen) root.dataset.theme = chosen;
  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : system.matches);
  const show = () => write(find("theme"), isDark() ? "Light" : "Dark");
  const toggle = () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    storage()?.setItem(KEPT, root.dataset.theme);
    show();
    changed();
  };
  system.addEventListener("change", () => {
    show();
    changed();
  });
  find("theme").addEventListener("click", toggle);
  show();
  return toggle;
}

// The style sheet's colours, for what is painted by hand: one place says what they are.

const NAMES = [
  "bg", "panel", "ink", "mute", "line", "band", "accent", "on-accent", "excite",
  "inhibit", "wave", "on-wave", "bad", "first", "second", "third", "fourth",
];

/** The colours of the present scheme by name. */
export function palette() {
  // Only a property that takes colours has them worked out: light or dark.
  const probe = document.createElement("i");
  document.body.append(probe);
  const colours = {};
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return colours;
}

/** The font of what is painted, at a size in pixels. */
export const font = (size) => `${size}px system-ui, "Segoe UI", "DejaVu Sans", sans-serif`;
