"""Splits a dual with 3-cubes into flat layers drawn side by side.

Cutting along all hyperplanes of one direction leaves pieces one dimension lower. Two
neighbouring layers are joined wherever both have a vertex at the same place.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.dual_panel import dual_panel
from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.model import Model
from neurosnap.apps.drawing.panel import PALE, Panel, beside, lines, stacked

MOST = 12
"""The most layers that are drawn."""

_IN_A_ROW = 4


def layers(view: View) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return the layers of a dual: what they are, and their vertices.

    Returns:
        None of them if there is no cube, or too many layers come out.
    """
    cut = _cut(view)
    if not cut.any():
        return []
    rows = view.corners[:, cut]
    keys = np.unique(rows, axis=0)
    if len(keys) > MOST:
        return []
    places = keys @ view.layout.directions[cut]
    found = []
    for k in np.lexsort((places[:, 1], places[:, 0])).tolist():
        chosen = (rows == keys[k]).all(1)
        found.append((_called(view, cut, keys[k]), chosen))
    return found


def layers_panel(model: Model, view: View, unit: float) -> Panel | None:
    """Return the layers of a dual, side by side; None if it has no cubes."""
    found = layers(view)
    if not found:
        return None
    panels = [
        stacked([lines([called], 9), dual_panel(model, view, unit, chosen)], 0.1)
        for called, chosen in found
    ]
    rows = [
        beside(panels[k : k + _IN_A_ROW], 0.55)
        for k in range(0, len(panels), _IN_A_ROW)
    ]
    cut = ", ".join(view.element(k) for k in np.flatnonzero(_cut(view)).tolist())
    words = [
        f"The same dual, cut along {cut} into layers.",
        "Vertices at the same place in neighbouring layers are joined.",
    ]
    return stacked([lines(words, 9, PALE), *rows], 0.2)


def _cut(view: View) -> NDArray[np.bool_]:
    """Return the elements to cut along: whole directions, until no cube is left."""
    families = view.layout.families
    count = len(view.own)
    crossing = np.zeros((count, count), np.int64)
    crossing[view.sides[:, 0], view.sides[:, 1]] = 1
    crossing |= crossing.T
    cut = np.zeros(count, np.bool_)
    while _cubes(crossing, ~cut):
        # The direction that takes out most; of equals the shortest and last one.
        left = np.unique(families[~cut]).tolist()
        cut |= families == min(
            left,
            key=lambda family: (
                _cubes(crossing, ~cut & (families != family)),
                int((families == family).sum()),
                -family,
            ),
        )
    return cut


def _cubes(crossing: NDArray[np.int64], kept: NDArray[np.bool_]) -> int:
    """Return how many times three of the kept elements cross, six times each."""
    among = crossing[np.ix_(kept, kept)]
    return int(np.trace(among @ among @ among))


def _called(view: View, cut: NDArray[np.bool_], key: NDArray[np.bool_]) -> str:
    """Return what is on throughout a layer, less what follows from the rest of it."""
    order = view.poc.order
    among = [a for a, chosen in zip(view.own, cut, strict=True) if chosen]
    on = [a for a, bit in zip(among, key.tolist(), strict=True) if bit]
    least = [a for a in on if not any(order[b, a] for b in on if b != a)]
    if least:
        return "where " + " and ".join(view.poc.name(a) for a in least)
    off = [a for a in among if not any(order[a, b] for b in among if b != a)]
    return "where " + " and ".join(view.poc.name(a ^ 1) for a in off)
