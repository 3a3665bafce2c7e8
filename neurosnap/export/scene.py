"""The learned order and the state as scenes for a viewer's 3D panel.

A viewer that jumps to some moment shows the last message before it alone, so each
scene holds all that is to be seen on its topic, and none builds on the one before.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.export.arrange import arranged
from neurosnap.poc.graph import PocGraph
from neurosnap.sensorium import Sensorium

Scene: TypeAlias = dict[str, Any]
"""A ``foxglove.SceneUpdate``."""

FRAME = "order"

_LINE_LIST = 2
_THICK = 0.03
_LETTER = 0.25
_BALL = 0.3
_BELOW_LETTERS = 0.3  # from the middle of a ball to the text above it
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


def order_scene(graph: PocGraph, sensorium: Sensorium, time: int) -> Scene:
    """Return the Hasse diagram of an order, with names.

    Every edge leads upwards: blue ones excite, orange ones inhibit, grey ones join
    what is equivalent, without a direction.

    Args:
        graph: The order of N sensors.
        sensorium: Their names.
        time: Nanoseconds since the epoch.
    """
    places = arranged(graph)
    pairs = np.argwhere(graph.hasse())
    below, above = pairs.T
    same = graph.representative[below] == graph.representative[above]
    inhibits = above % 2 == 1
    lines = [
        _lines(places[pairs[chosen]], colour)
        for chosen, colour in (
            (~same & ~inhibits, _EXCITES),
            (~same & inhibits, _INHIBITS),
            (same & (below < above), _SAME),
        )
    ]
    texts = [
        {
            "pose": _pose((x, y, z + _BELOW_LETTERS)),
            "billboard": True,
            "font_size": _LETTER,
            "scale_invariant": False,
            "color": _INK,
            "text": sensorium.name(literal),
        }
        for literal, (x, y, z) in enumerate(places.tolist())
    ]
    return _scene("order", time, lines=lines, texts=texts)


def state_scene(graph: PocGraph, state: NDArray[np.bool_], time: int) -> Scene:
    """Return a ball for every literal: green in the state, grey if its complement is.

    Yellow where neither is.

    Args:
        graph: The order of N sensors, which says where they stand.
        state: ``(2N,)`` bool.
        time: Nanoseconds since the epoch.
    """
    size = {"x": _BALL, "y": _BALL, "z": _BALL}
    balls = [
        {
            "pose": _pose(place),
            "size": size,
            "color": _ON if on else _OFF if off else _OPEN,
        }
        for place, on, off in zip(
            arranged(graph).tolist(),
            state.tolist(),
            state.reshape(-1, 2)[:, ::-1].ravel().tolist(),
            strict=True,
        )
    ]
    return _scene("state", time, spheres=balls)


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


def _lines(ends: NDArray[np.float64], colour: dict[str, float]) -> dict[str, Any]:
    """Return separate lines; `ends` is ``(lines, 2, 3)``."""
    return {
        "type": _LINE_LIST,
        "pose": _pose((0.0, 0.0, 0.0)),
        "thickness": _THICK,
        "scale_invariant": False,
        "points": [_vector(end) for end in ends.reshape(-1, 3).tolist()],
        "color": colour,
        "colors": [],
        "indices": [],
    }


def _pose(place: Sequence[float]) -> dict[str, dict[str, float]]:
    upright = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    return {"position": _vector(place), "orientation": upright}


def _vector(place: Sequence[float]) -> dict[str, float]:
    x, y, z = place
    return {"x": round(x, 3), "y": round(y, 3), "z": round(z, 3)}
