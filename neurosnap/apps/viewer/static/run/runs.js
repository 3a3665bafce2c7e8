// Which of the server's recordings is looked at: one is chosen in the head of the page, and
// the page is opened anew with it.

import { keep, told } from "../base/address.js";
import { fetchRuns, run } from "../base/api.js";
import { find, make } from "../base/dom.js";

/** Show the recordings there are, where there are several; return them. */
export async function chooseRun() {
  const runs = await fetchRuns();
  const choice = find("run");
  choice.hidden = runs.length < 2;
  choice.replaceChildren(
    ...runs.map(({ name, live }, number) =>
      make("option", { value: number }, live ? `${name} (live)` : name),
    ),
  );
  choice.value = run;
  choice.addEventListener("change", () => {
    keep({ run: choice.value === "0" ? null : choice.value });
    location.reload();
  });
  addEventListener("hashchange", () => {
    if ((told().get("run") ?? "0") !== run) location.reload();
  });
  return runs;
}
