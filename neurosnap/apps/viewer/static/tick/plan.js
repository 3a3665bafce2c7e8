// A plan: its steps in a row, those that were taken, this one, and those to come.

import { make } from "../base/dom.js";

/** Return a list of the steps of a plan. */
export function stepsOf({ steps, at, more }, actions) {
  const items = steps.map((action, place) => {
    const item = make("li", { className: place < at ? "done" : "" }, actions[action]);
    if (place === at) item.setAttribute("aria-current", "step");
    return item;
  });
  if (more > 0) items.push(make("li", { className: "more" }, `${more} more`));
  const label = `Plan: step ${at + 1} of ${steps.length + more}`;
  return make("ol", { className: "plan", ariaLabel: label }, ...items);
}
