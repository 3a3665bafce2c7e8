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
