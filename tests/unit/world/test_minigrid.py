"""Mazes of MiniGrid keep their layout, and tables of them match MiniGrid itself."""

import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, MissingExtraError
from tools.paper.worlds_as_tables import maze_table
from world.minigrid import ACTIONS, LAYOUTS, minigrid, standing

pytest.importorskip("minigrid")


@pytest.mark.parametrize(
    "layout", ["Empty-5x5", "DoorKey-5x5", "DoorKey-6x6", "Unlock"]
)
@pytest.mark.slow
def test_a_walk_is_the_one_minigrid_makes_and_draws(layout: str) -> None:
    name = f"MiniGrid-{layout}-v0"
    real: Any = gymnasium.make(name, max_steps=999, render_mode="rgb_array").unwrapped
    env: Any = minigrid(layout, 3, render_mode="rgb_array")
    table, states = maze_table(env)
    over, state = True, 0
    for step, action in enumerate(np.random.default_rng(0).integers(5, size=400)):
        if over:
            real.reset(seed=3)
            env.reset()
            state = 0
        if step % 5 == 0 and layout == "DoorKey-5x5":  # drawing is slow
            np.testing.assert_array_equal(env.render(), real.render())
        real.step(ACTIONS.index(env.actions[action]))
        _, reward, over, _, _ = env.step(action)
        ((_, state, *foretold),) = table[state][action]
        assert [reward, over] == foretold
        assert standing(env) == standing(real) == states[state]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_layout_is_drawn_by_its_seed_and_stays(layout: str) -> None:
    def begun(env: Any, seed: int) -> tuple[Any, ...]:
        bits, _ = env.reset(seed=seed)
        return standing(env), env.unwrapped.grid.encode().tolist(), bits.tolist()

    env = minigrid(layout)
    first = begun(env, 7)
    env.step(1)
    assert begun(env, 8) == begun(minigrid(layout), 9) == first
    assert (begun(minigrid(layout, 1), 7) == first) == layout.startswith("Empty")


def test_the_key_opens_the_door_and_the_goal_is_rewarded_however_late() -> None:
    actions = ("toggle", "pickup", "forward", "right", "done")
    env = gymnasium.make("neurosnap/MiniGrid-v0", layout="DoorKey-5x5", actions=actions)
    env.reset()
    way = "toggle right pickup forward forward right toggle toggle toggle forward"
    way = f"{300 * 'done '} {way} forward right forward forward"
    steps = [env.step(actions.index(name)) for name in way.split()]
    names = np.array(env.get_wrapper_attr("sensors"))
    bits = np.array([step[0] for step in steps[300:]])
    assert bits[:, names == "carries=key"].ravel().tolist() == [0, 0] + 12 * [1]
    assert bits[6:, names == "door=open"].ravel().tolist() == [1, 0, 1, 1, 1, 1, 1, 1]
    assert " ".join(names[bits[0] == 1]) == "column<2 column<3 facing=west door=locked"
    went_on, at_goal = (0, False, False), (1.0, True, False)
    assert [step[1:4] for step in steps] == [*313 * [went_on], at_goal]


def test_the_key_is_dropped_before_the_ball_is_taken() -> None:
    arguments: dict[str, Any] = {"layout": "KeyCorridorS3R1", "actions": ACTIONS[:6]}
    env = gymnasium.make("neurosnap/MiniGrid-v0", **arguments)
    names = np.array(env.get_wrapper_attr("sensors"))
    seen = [env.reset()[0]]
    way = "right toggle forward pickup right right forward toggle left left forward"
    way = f"{way} drop right right forward forward pickup"
    steps = [env.step(ACTIONS.index(name)) for name in way.split()]
    assert [step[1:4] for step in steps[-2:]] == [(0, False, False), (1.0, True, False)]
    bits = np.array(seen + [step[0] for step in steps])
    read = {str(name): bits[:, k].tolist() for k, name in enumerate(names)}
    assert read["carries=key"] == [0] * 4 + [1] * 8 + [0] * 6
    assert read["key_column<2"] == [1] * 18  # there, or carried
    assert read["door_1=open"] == [0] * 2 + [1] * 16
    assert read["door_2=locked"] == [1] * 8 + [0] * 10
    assert read["carries=ball"] == read["ball_column<5"] == [0] * 17 + [1]


@pytest.mark.parametrize(
    ("layout", "actions"),
    [
        ("Empty-5x5", ACTIONS[:4]),
        ("DoorKey-5x5", (*ACTIONS[:4], "toggle")),
        ("Unlock", (*ACTIONS[:4], "toggle")),
        ("MultiRoom-N2-S4", (*ACTIONS[:3], "toggle")),
        ("KeyCorridorS3R1", ACTIONS[:6]),
    ],
)
def test_sensors_tell_all_states_apart(layout: str, actions: tuple[str, ...]) -> None:
    env = minigrid(layout, actions=actions)
    _, states = maze_table(env)
    fields = np.array([[sensor(one) for one in states] for sensor in env.definitions])
    assert len(np.unique(fields.T, axis=0)) == len(states)
    if layout in ("Empty-5x5", "DoorKey-5x5"):  # where one can get anywhere
        assert not fields.all(axis=1).any()
        assert fields.any(axis=1).all()


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
