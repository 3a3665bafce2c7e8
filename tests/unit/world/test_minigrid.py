"""Tables of MiniGrid's mazes match MiniGrid itself."""

import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

import world
from neurosnap.errors import InvalidValueError, MissingExtraError
from tests.support.transition_tables import Table, state_fields
from world.minigrid import ACTIONS, LAYOUTS, minigrid

pytest.importorskip("minigrid")


@pytest.mark.parametrize("layout", ["Empty-5x5", "DoorKey-5x5", "DoorKey-6x6"])
@pytest.mark.slow
def test_a_walk_is_the_one_minigrid_makes_and_draws(layout: str) -> None:
    """Through the door: whatever happened before, the state alone is drawn."""
    from minigrid import envs

    kind, arguments = LAYOUTS[layout]
    real: Any = getattr(envs, kind)(**arguments, render_mode="rgb_array")
    env: Any = minigrid(layout, 3, render_mode="rgb_array")
    plain: Any = minigrid(layout, 3)
    maze = env.unwrapped
    pictures = set()
    over = True
    for step, action in enumerate(np.random.default_rng(0).integers(5, size=400)):
        if over:
            real.reset(seed=3)
            env.reset()
            plain.reset()
        if step % 5 == 0 and layout == "DoorKey-5x5":  # drawing is slow
            picture = env.render()
            np.testing.assert_array_equal(picture, real.render())
            pictures.add(picture.tobytes())
        real.step_count = 0
        _, reward, over, _, _ = real.step(ACTIONS.index(env.actions[action]))
        bits, env_reward, env_over, _, _ = env.step(action)
        np.testing.assert_array_equal(bits, plain.step(action)[0])
        cell = maze.cells[maze.s]
        assert (cell.column, cell.row) == tuple(real.agent_pos)
        assert cell.facing == ("east", "south", "west", "north")[real.agent_dir]
        assert (cell.carries == "key") == (real.carrying is not None)
        assert (over, reward > 0) == (env_over, env_reward > 0)
    assert env.render_mode == "rgb_array"
    assert len(pictures) > 10 or layout != "DoorKey-5x5"
    assert plain.render() is None
    for one in (env, plain, real):
        one.close()


@pytest.mark.parametrize("layout", ["Empty-5x5", "DoorKey-5x5"])
def test_sensors_tell_all_states_apart_and_none_is_always_the_same(layout: str) -> None:
    env = minigrid(layout)
    table = Table.of(env)
    fields = state_fields(env, table)
    assert len(np.unique(fields.T, axis=0)) == len(table.states)
    assert not fields.all(axis=1).any()
    assert fields.any(axis=1).all()


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
