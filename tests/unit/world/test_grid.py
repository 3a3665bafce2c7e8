"""Grids, whole and with a hole: steps and coordinates against plain geometry."""

import itertools
from typing import Literal

import numpy as np
import pytest

from world.grid import GridWorld

CHANGES = {"up": (0, 1), "down": (0, -1), "left": (-1, 0), "right": (1, 0)}
SIZES = [(3, 3), (4, 3), (6, 5)]
HOLES = [(3, 3, (1, 1)), (4, 3, (2, 1)), (6, 5, (1, 1)), (6, 5, (4, 3)), (6, 5, (2, 3))]
"""The only place for one, and the corners of where one may be."""
MIDDLES = [(11, 11, "middle"), (3, 3, "middle"), (4, 7, "middle")]


def check_steps(env: GridWorld, points: set[tuple[int, int]]) -> None:
    """Every move leads to the point beside, or stays where there is none."""
    at = [(int(x), int(y)) for x, y in env.coordinates]
    assert len(at) == len(points)
    assert set(at) == points
    for action, row in zip(env.actions, env.moves, strict=True):
        for (x, y), there in zip(at, row, strict=True):
            right, up = CHANGES[action]
            beside = (x + right, y + up)
            assert at[there] == (beside if beside in points else (x, y))


@pytest.mark.parametrize(("width", "height"), [(2, 2), (2, 5), *SIZES])
def test_a_step_in_the_grid_leads_to_the_point_beside(width: int, height: int) -> None:
    env = GridWorld(width, height)
    check_steps(env, set(itertools.product(range(width), range(height))))
    place = np.arange(width * height)
    x, y = env.coordinates.T
    np.testing.assert_array_equal(x + width * y, place)


@pytest.mark.parametrize(("width", "height", "hole"), [*HOLES, *MIDDLES])
def test_a_hole_is_walked_around_and_changes_nothing_there_is_to_learn(
    width: int, height: int, hole: tuple[int, int] | Literal["middle"]
) -> None:
    env, whole = GridWorld(width, height, hole), GridWorld(width, height)
    if hole == "middle":
        hole = (width // 2, height // 2)
    check_steps(env, set(itertools.product(range(width), range(height))) - {hole})
    assert env.sensors == whole.sensors
    assert env.implications == whole.implications
