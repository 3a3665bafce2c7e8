// A picture of the order that is kept: all that is laid out, at the size its names are
// read at, as an SVG or a PNG file.

import { NodePainter } from "./nodes.js";
import { paintLines, paintNodes, paintWave } from "./painting.js";
import { SvgContext } from "./svg_context.js";

const MARGIN = 28; // the layers' numbers stand in it
const DOTS = 2; // of a PNG, for each unit
const [LONGEST, MOST] = [16000, 6e7]; // dots of a side, and in all, that browsers paint

/** The picture as the text of an SVG file. */
export function asSvg(scene, box, title) {
  const { width, height, camera } = around(box);
  const context = new SvgContext(width, height);
  paintAll(context, scene, { camera, width, height, dots: 1, painter: new NodePainter() });
  return context.file(title);
}

/**
 * The picture as a PNG file: two dots for each unit, fewer if it is too large for that.
 *
 * @returns {Promise<Blob|null>} null: the browser cannot paint it
 */
export function asPng(scene, box) {
  const { width, height, camera } = around(box);
  const dots = Math.min(DOTS, LONGEST / Math.max(width, height), Math.sqrt(MOST / (width * height)));
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height].map((side) => Math.round(side * dots));
  const context = canvas.getContext("2d");
  paintAll(context, scene, { camera, width, height, dots, painter: new NodePainter() });
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

function paintAll(context, scene, sheet) {
  context.fillStyle = sheet.painter.colours.panel;
  context.fillRect(0, 0, sheet.width * sheet.dots, sheet.height * sheet.dots);
  paintLines(context, scene, sheet);
  paintNodes(context, scene, sheet);
  paintWave(context, scene, sheet);
}

function around({ left, right, top, bottom }) {
  return {
    width: right - left + 2 * MARGIN,
    height: bottom - top + 2 * MARGIN,
    camera: { scale: 1, left: MARGIN - left, top: MARGIN - top },
  };
}
