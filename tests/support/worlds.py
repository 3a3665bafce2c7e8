"""Worlds of every kind, with arguments of every kind."""

from typing import Any

import gymnasium
import numpy as np

from world.places import PlacesWorld
from world.target import Target

KINDS = ("Path", "Cycle", "Grid", "RandomFields", "PuncturedGrid", "Rail")
IDS = [f"neurosnap/{name}-v0" for name in KINDS]


# id, arguments, sensors, actions, places
SHAPES: list[tuple[str, dict[str, Any], int, int, int]] = [
    ("neurosnap/Path-v0", {}, 20, 2, 21),
    ("neurosnap/Path-v0", {"places": 2}, 1, 2, 2),
    ("neurosnap/Cycle-v0", {}, 20, 2, 20),
    ("neurosnap/Cycle-v0", {"places": 4}, 4, 2, 4),
    ("neurosnap/Grid-v0", {}, 20, 4, 121),
    ("neurosnap/Grid-v0", {"width": 3, "height": 5}, 6, 4, 15),
    ("neurosnap/RandomFields-v0", {}, 20, 2, 21),
    ("neurosnap/RandomFields-v0", {"places": 3, "sensors": 30}, 30, 2, 3),
    ("neurosnap/PuncturedGrid-v0", {}, 20, 4, 120),
    ("neurosnap/PuncturedGrid-v0", {"width": 3, "height": 3}, 4, 4, 8),
    ("neurosnap/PuncturedGrid-v0", {"width": 5, "height": 4, "hole": (3, 1)}, 7, 4, 19),
    ("neurosnap/Rail-v0", {}, 24, 3, 24),
    ("neurosnap/Rail-v0", {"wait": False}, 24, 2, 24),
    ("neurosnap/Cycle-v0", {"wait": True, "places": 7}, 7, 3, 7),
    ("neurosnap/PuncturedGrid-v0", {"wait": True}, 20, 5, 120),
]

NAMED = [(name, arguments) for name, arguments, *_ in SHAPES]


# A target at the place with the highest number, at the lowest, and drawn; sizes too.
TARGETS: list[tuple[str, dict[str, Any]]] = [
    *((name, {"target": 0}) for name in IDS),
    *((name, {"target": "drawn"}) for name in IDS),
    ("neurosnap/Path-v0", {"target": 4, "places": 5, "wait": False}),
    ("neurosnap/Cycle-v0", {"target": 5, "places": 6, "wait": False}),
    ("neurosnap/Grid-v0", {"target": 14, "width": 3, "height": 5}),
    ("neurosnap/RandomFields-v0", {"target": "drawn", "places": 3, "sensors": 30}),
    ("neurosnap/PuncturedGrid-v0", {"target": 7, "width": 3, "height": 3}),
    ("neurosnap/Rail-v0", {"target": 23}),
]


def aimed(name: str, **arguments: Any) -> Target:
    env = gymnasium.make(name, **arguments)
    while not isinstance(env, Target):
        assert isinstance(env, gymnasium.Wrapper)
        env = env.env
    return env


def make(name: str, **arguments: Any) -> PlacesWorld:
    env = gymnasium.make(name, **arguments).unwrapped
    assert isinstance(env, PlacesWorld)
    return env


def started(name: str, seed: int = 7, **arguments: Any) -> PlacesWorld:
    env = make(name, **arguments)
    env.reset(seed=seed)
    return env


def rollout(
    env: PlacesWorld | Target, seed: int, steps: int = 200
) -> tuple[np.ndarray[Any, Any], list[int]]:
    moves = env.get_wrapper_attr("moves")
    actions = np.random.default_rng(seed).integers(len(moves), size=steps)
    observation, info = env.reset(seed=seed)
    observations, places = [observation], [info["place"]]
    for action in actions:
        observation, _, _, _, info = env.step(action)
        observations.append(observation)
        places.append(info["place"])
    return np.array(observations), places
