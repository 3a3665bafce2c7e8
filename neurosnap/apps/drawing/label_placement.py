"""Places labels beside points so that they cover neither points nor lines."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.layout_cost import Floats, Indices

_WIDE = 0.025  # half of a line, and a bit
_STEP = 0.04  # between the points of a line that are looked at
_ANGLES = np.deg2rad([0, 30, 150, 60, 120, 330, 210, 300, 240, 90, 270, 180])
_FAR = (0.02, 0.07, 0.13, 0.2)


def place_labels(
    points: Floats, lines: Indices, sizes: Floats, radii: Floats
) -> list[tuple[float, float] | None]:
    """Return the middles of labels, one a point.

    Args:
        points: ``(n, 2)``.
        lines: ``(k, 2)``: the points that are joined.
        sizes: ``(n, 2)``: width and height of each label.
        radii: ``(n,)``: how far each point's mark reaches.

    Returns:
        None where a label has no room: it would cover a point or another label.
    """
    ink = _sampled(points, lines)
    taken = np.zeros((0, 4))
    found: list[tuple[float, float] | None] = [None] * len(points)
    middle = points.mean(0) if len(points) else np.zeros(2)
    # From outside in: those outside have the clear choice.
    for k in np.argsort(-np.linalg.norm(points - middle, axis=1), kind="stable"):
        spots = _spots(points[k], sizes[k], float(radii[k]))
        best, least = None, np.inf
        for number, spot in enumerate(spots):
            box = np.concatenate([spot - sizes[k] / 2, spot + sizes[k] / 2])
            if (
                _inside(points, box, radii[:, None]).any()
                or _overlaps(taken, box).any()
            ):
                continue
            cost = 3 * int(_inside(ink, box, _WIDE).sum()) + 0.2 * number
            if cost < least:
                best, least = box, cost
        if best is not None:
            taken = np.vstack([taken, best])
            found[int(k)] = (
                float(best[0] + best[2]) / 2,
                float(best[1] + best[3]) / 2,
            )
    return found


def _spots(point: Floats, size: Floats, radius: float) -> Floats:
    """Return the middles that a label of a point may have, the nearest first."""
    ways = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
    # As far as it takes for the box not to hold the point, whatever the angle.
    room = size / 2 / np.maximum(np.abs(ways), 1e-9)
    reach = np.minimum(room.min(axis=1), np.linalg.norm(size) / 2)[:, None]
    rings = [point + ways * (reach + radius + far) for far in _FAR]
    return np.concatenate(rings)


def _sampled(points: Floats, lines: Indices) -> Floats:
    """Return points along lines."""
    pieces = [np.zeros((0, 2))]
    for a, b in lines.tolist():
        many = max(int(np.linalg.norm(points[b] - points[a]) / _STEP), 2)
        share = np.linspace(0, 1, many)[:, None]
        pieces.append(points[a] + share * (points[b] - points[a]))
    return np.concatenate(pieces)


def _inside(points: Floats, box: Floats, margin: Floats | float) -> NDArray[np.bool_]:
    within = (points > box[:2] - margin) & (points < box[2:] + margin)
    return np.logical_and(within[:, 0], within[:, 1])


def _overlaps(boxes: Floats, box: Floats) -> NDArray[np.bool_]:
    meets = (boxes[:, :2] < box[2:]) & (boxes[:, 2:] > box[:2])
    return np.logical_and(meets[:, 0], meets[:, 1])
