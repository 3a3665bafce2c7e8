"""MiniGrid's mazes as tables: what they are is what MiniGrid does."""

import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

import world
from neurosnap.errors import InvalidValueError, MissingExtraError
from tests.support.transition_tables import Table, state_fields
from world.minigrid import ACTIONS, LAYOUTS, Maze, minigrid

pytest.importorskip("minigrid")


@pytest.mark.parametrize("layout", ["Empty-5x5", "DoorKey-5x5", "DoorKey-6x6"])
def test_a_walk_is_the_one_minigrid_makes(layout: str) -> None:
    from minigrid import envs

    maze = Maze(layout, 3, ACTIONS[:4] + ACTIONS[5:6])
    kind, arguments = LAYOUTS[layout]
    real: Any = getattr(envs, kind)(**arguments)
    real.reset(seed=3)
    maze.reset()
    rng = np.random.default_rng(0)
    for action in rng.integers(5, size=400).tolist():
        real.step_count = 0
        _, reward, over, _, _ = real.step((0, 1, 2, 3, 5)[action])
        _, table_reward, table_over, _, _ = maze.step(action)
        cell = maze.cells[maze.s]
        assert (cell.column, cell.row) == tuple(real.agent_pos)
        assert cell.facing == ("east", "south", "west", "north")[real.agent_dir]
        assert (cell.carries == "key") == (real.carrying is not None)
        assert (over, reward > 0) == (table_over, table_reward > 0)
        if over:
            real.reset(seed=3)
            maze.reset()
    real.close()


@pytest.mark.parametrize("layout", ["Empty-5x5", "DoorKey-5x5"])
def test_sensors_tell_all_states_apart_and_none_is_always_the_same(layout: str) -> None:
    env = minigrid(layout)
    table = Table.of(env)
    fields = state_fields(env, table)
    assert len(np.unique(fields.T, axis=0)) == len(table.states)
    assert not fields.all(axis=1).any()
    assert fields.any(axis=1).all()


def test_it_draws_what_minigrid_draws() -> None:
    """Through the door: whatever happened before, the state alone is drawn."""
    from minigrid import envs

    layout, seed = "DoorKey-5x5", 3
    kind, arguments = LAYOUTS[layout]
    real: Any = getattr(envs, kind)(**arguments, render_mode="rgb_array")
    real.reset(seed=seed)
    env: Any = minigrid(layout, seed, render_mode="rgb_array")
    plain = minigrid(layout, seed)
    assert env.render_mode == "rgb_array"
    env.reset()
    plain.reset()
    chance = np.random.default_rng(1)
    pictures = set()
    for step in range(400):
        if step % 5 == 0:  # drawing is slow
            picture = env.render()
            np.testing.assert_array_equal(picture, real.render())
            pictures.add(picture.tobytes())
        action = int(chance.integers(len(env.actions)))
        seen, _, over, _, _ = env.step(action)
        np.testing.assert_array_equal(seen, plain.step(action)[0])
        real.step_count = 0
        real.step(ACTIONS.index(env.actions[action]))
        if over:
            break
    assert len(pictures) > 10
    for one in (env, plain, real):
        one.close()
    assert plain.render() is None


def test_it_is_registered_and_takes_other_actions() -> None:
    assert world.__name__ == "world"
    env: Any = gymnasium.make(
        "neurosnap/MiniGrid-v0", layout="Empty-5x5", actions=("left", "forward")
    )
    assert env.get_wrapper_attr("actions") == ("left", "forward")
    bits, _ = env.reset()
    names = np.array(env.get_wrapper_attr("sensors"))[np.asarray(bits, np.bool_)]
    assert set(names) == {"row<2", "row<3", "column<2", "column<3", "facing=east"}
    env.close()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"layout": "Maze"}, "layout"),
        ({"actions": ()}, "actions"),
        ({"actions": ("fly",)}, "actions"),
    ],
)
def test_there_is_no_other_layout_or_action(
    arguments: dict[str, Any], named: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{named}: must be"):
        minigrid(**arguments)


def test_without_the_package_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "minigrid", None)
    with pytest.raises(MissingExtraError, match=r"neurosnap-uma\[minigrid\]"):
        minigrid()
