"""3D scenes of the learned order and the state, for Foxglove.

A viewer that jumps to some moment shows the last message before it alone, so each
scene holds all that is to be seen on its topic, and none builds on the one before.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.export.hasse_layout_3d import arranged
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium

Scene: TypeAlias = dict[str, Any]
"""A ``foxglove.SceneUpdate``."""

_Vector: TypeAlias = dict[str, float]

FRAME = "order"

_LINE_LIST = 2
_ORIGIN = {"x": 0.0, "y": 0.0, "z": 0.0}
_UPRIGHT = {**_ORIGIN, "w": 1.0}
_THICK = 1.5  # pixels: in the scene's own units, lines far away come out dotted
_CLEAR = 200
"""Lines; more of them are drawn fainter, or they would hide one another."""
_FAINTEST = 0.05
_LETTER = 0.25
_BALL = 0.3
_UNDER_LETTERS = (0.0, 0.0, 0.3)  # from the middle of a ball to the text above it
# Okabe and Ito's, who are told apart by everybody.
_EXCITES = {"r": 0.0, "g": 0.45, "b": 0.7, "a": 0.8}
_INHIBITS = {"r": 0.84, "g": 0.37, "b": 0.0, "a": 0.8}
_SAME = {"r": 0.6, "g": 0.6, "b": 0.6, "a": 0.8}
_INK = {"r": 0.7, "g": 0.7, "b": 0.7, "a": 1.0}
_ON = {"r": 0.0, "g": 0.62, "b": 0.45, "a": 1.0}
_OFF = {"r": 0.5, "g": 0.5, "b": 0.5, "a": 0.25}
_OPEN = {"r": 0.94, "g": 0.89, "b": 0.26, "a": 0.6}


def stamp(nanoseconds: int) -> dict[str, int]:
    """Return a time as viewers take it."""
    sec, nsec = divmod(nanoseconds, 10**9)
    return {"sec": sec, "nsec": nsec}


def order_scene(
    graph: PocGraph, sensorium: Sensorium, time: int, read: Sequence[int] | None = None
) -> Scene:
    """Return the Hasse diagram of an order, with names.

    Every edge leads upwards: blue ones excite, orange ones inhibit, grey ones join
    what is equivalent, without a direction; the more there are, the fainter.

    Args:
        graph: The order of N sensors.
        sensorium: Their names.
        time: Nanoseconds since the epoch.
        read: The sensors to draw; None: all.
    """
    places = arranged(graph)
    spots = _vectors(places)
    pairs = np.argwhere(graph.hasse())
    below, above = pairs.T
    same = graph.representative[below] == graph.representative[above]
    clear = max(_FAINTEST, min(1.0, _CLEAR / max(1, len(pairs))))
    shown = _drawn(graph, read)
    inhibits = above % 2 == 1
    lines = [
        _lines(
            [spots[a] for a in pairs[chosen].ravel().tolist()],
            {**colour, "a": colour["a"] * clear},
        )
        for chosen, colour in (
            (~same & ~inhibits, _EXCITES),
            (~same & inhibits, _INHIBITS),
            (same & (below < above), _SAME),
        )
    ]
    texts = [
        {
            "pose": _pose(spot),
            "billboard": True,
            "font_size": _LETTER,
            "scale_invariant": False,
            "color": _INK,
            "text": sensorium.name(literal),
        }
        for literal, spot in enumerate(_vectors(places + _UNDER_LETTERS))
        if shown[literal]
    ]
    return _scene("order", time, lines=lines, texts=texts)


def state_scene(
    graph: PocGraph,
    state: NDArray[np.bool_],
    time: int,
    read: Sequence[int] | None = None,
) -> Scene:
    """Return a ball for every literal: green in the state, grey if its complement is.

    Yellow where neither is.

    Args:
        graph: The order of N sensors, which says where they stand.
        state: ``(2N,)`` bool.
        time: Nanoseconds since the epoch.
        read: The sensors to draw; None: all.
    """
    size = {"x": _BALL, "y": _BALL, "z": _BALL}
    balls = [
        {
            "pose": _pose(spot),
            "size": size,
            "color": _ON if on else _OFF if off else _OPEN,
        }
        for spot, on, off, shown in zip(
            _vectors(arranged(graph)),
            state.tolist(),
            state.reshape(-1, 2)[:, ::-1].ravel().tolist(),
            _drawn(graph, read),
            strict=True,
        )
        if shown
    ]
    return _scene("state", time, spheres=balls)


def _drawn(graph: PocGraph, read: Sequence[int] | None) -> list[bool]:
    """Return of each literal whether it is drawn: also a retired one with an edge."""
    if read is None:
        return [True] * len(graph)
    shown = {*read, *(np.argwhere(graph.hasse()) >> 1).ravel().tolist()}
    return [literal >> 1 in shown for literal in range(len(graph))]


def _scene(name: str, time: int, **primitives: list[dict[str, Any]]) -> Scene:
    """Return a scene of one entity, which stays until another of its name comes."""
    entity = {
        "timestamp": stamp(time),
        "frame_id": FRAME,
        "id": name,
        "lifetime": stamp(0),
        "frame_locked": False,
        "metadata": [],
        "arrows": [],
        "cubes": [],
        "spheres": [],
        "cylinders": [],
        "lines": [],
        "triangles": [],
        "texts": [],
        "models": [],
    }
    return {"deletions": [], "entities": [{**entity, **primitives}]}


def _lines(ends: list[_Vector], colour: dict[str, float]) -> dict[str, Any]:
    """Return separate lines, from each first of two ends to the second."""
    return {
        "type": _LINE_LIST,
        "pose": _pose(_ORIGIN),
        "thickness": _THICK,
        "scale_invariant": True,
        "points": ends,
        "color": colour,
        "colors": [],
        "indices": [],
    }


def _pose(place: _Vector) -> dict[str, _Vector]:
    return {"position": place, "orientation": _UPRIGHT}


def _vectors(places: NDArray[np.float64]) -> list[_Vector]:
    """Return points as viewers take them; `places` is ``(points, 3)``."""
    return [{"x": x, "y": y, "z": z} for x, y, z in places.round(3).tolist()]
