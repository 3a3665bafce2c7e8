// Files that the page gives: the picture of the order, and the table of the panel that is
// open.

import { asCsv, rowsOf } from "./base/csv.js";
import { find, flash } from "./base/dom.js";
import { asPng, asSvg } from "./order/picture.js";

const READING = "the recording is still being read: save it in a moment";
const TOO_LARGE = "too large for this browser to paint: save it as SVG";

/** Have the buttons save what the page shows. */
export function bindFiles(page) {
  const onClick = (id, act) => find(id).addEventListener("click", () => {
    if (page.frame) act();
    else page.voice.tell("there is no tick to save");
  });
  const shown = () => {
    const { run, frame, diagram } = page;
    const name = run.log.replace(/\.mcap$/, "");
    return { name: `${name}-tick-${frame.tick}`, title: `${run.log}, tick ${frame.tick}`, diagram };
  };
  onClick("save-svg", () => {
    const { name, title, diagram } = shown();
    const svg = asSvg(diagram.scene, diagram.box, `Learned order of ${title}`);
    save(`${name}.svg`, new Blob([svg], { type: "image/svg+xml" }));
  });
  onClick("save-png", async () => {
    const { name, diagram } = shown();
    const png = await asPng(diagram.scene, diagram.box);
    if (png) save(`${name}.png`, png);
    else page.voice.tell(TOO_LARGE);
  });
  onClick("save-csv", () => {
    const open = document.querySelector('#dock [role="tabpanel"]:not([hidden])');
    const views = { plots: page.plots, raster: page.raster, compare: page.compare };
    const view = views[open.id];
    if (view?.isReading) {
      page.voice.tell(READING);
      flash(find("save-csv"), "Still reading");
      return;
    }
    const rows = view?.rows() ?? rowsOf(open.querySelector("table"));
    const file = new Blob([asCsv(rows)], { type: "text/csv;charset=utf-8" });
    save(`${shown().name}-${open.id}.csv`, file);
  });
}

function save(name, blob) {
  const address = URL.createObjectURL(blob);
  const link = Object.assign(document.createElement("a"), { href: address, download: name });
  link.click();
  URL.revokeObjectURL(address);
}
