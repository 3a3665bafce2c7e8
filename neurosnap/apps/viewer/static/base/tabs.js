// Tabs as they are known from elsewhere: one is on, arrows go to the next.

/**
 * Make a list of tabs work.
 *
 * @param {HTMLElement} list
 * @param {(panel: string) => void} show told the id of the panel that comes up
 * @param {string|null} first the panel to begin with; none of these: that of the first tab
 */
export function tabs(list, show, first) {
  const all = [...list.querySelectorAll('[role="tab"]')];
  const panel = (tab) => document.getElementById(tab.getAttribute("aria-controls"));
  const select = (chosen) => {
    for (const tab of all) {
      tab.setAttribute("aria-selected", tab === chosen);
      tab.tabIndex = tab === chosen ? 0 : -1;
      panel(tab).hidden = tab !== chosen;
    }
    show(panel(chosen).id);
  };
  for (const [number, tab] of all.entries()) {
    tab.addEventListener("click", () => select(tab));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      const next = all[(number + by + all.length) % all.length];
      next.focus();
      select(next);
    });
  }
  select(all.find((tab) => tab.getAttribute("aria-controls") === first) ?? all[0]);
}
