// The hatching of what is predicted: stripes in a colour, as wide at every scale.

const SIZE = 6; // pixels until the stripes repeat

/** Make a pattern of stripes to fill with. */
export function hatching(context, colour) {
  const tile = context.newTile?.(SIZE) ?? canvasTile(); // an SVG has tiles of its own
  tile.strokeStyle = colour;
  tile.globalAlpha = 0.45;
  tile.lineWidth = 1.8;
  tile.beginPath();
  for (const shift of [-SIZE, 0, SIZE]) {
    tile.moveTo(shift, SIZE);
    tile.lineTo(shift + SIZE, 0);
  }
  tile.stroke();
  return context.createPattern(tile.canvas, "repeat");
}

function canvasTile() {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [SIZE, SIZE];
  return canvas.getContext("2d");
}
