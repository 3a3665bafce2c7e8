"""Sokoban's table is that of a board on which one walks and pushes."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from neurosnap.errors import InvalidValueError
from tools.paper.worlds_as_tables import Setting, stage_of
from world.sokoban import BOARD, SokobanEnv, sokoban

STEPS = {"up": (-1, 0), "right": (0, 1), "down": (1, 0), "left": (0, -1)}


def test_one_walks_and_pushes_and_is_stopped_by_walls() -> None:
    env: Any = gymnasium.make("neurosnap/Sokoban-v0", disable_env_checker=True)
    names, drawn = env.get_wrapper_attr("actions"), np.random.default_rng(0)
    free = {(r, c) for r in range(5) for c in range(5) if BOARD[r][c] != "#"}
    won, pushed, begun = list[float](), 0, set[Any]()
    for episode in range(80):
        env.reset(seed=episode)
        state = env.unwrapped.states[env.unwrapped._state]
        begun.add(state)
        over, reward = False, 0.0
        while not over:
            action = int(drawn.integers(4))
            down, right = STEPS[names[action]]
            me, box = state[:2], state[2:4]
            there = me[0] + down, me[1] + right
            beyond = there[0] + down, there[1] + right
            if there in free and (there != box or beyond in free):
                pushed += there == box
                me, box = there, beyond if there == box else box
            bits, reward, over, _, _ = env.step(action)
            state = env.unwrapped.states[env.unwrapped._state]
            assert state[:4] == (*me, *box)
            assert reward == (BOARD[box[0]][box[1]] == "G")
            said = dict(
                zip(env.get_wrapper_attr("sensors"), bits.tolist(), strict=True)
            )
            assert said["box=goal"] == reward
            corner = any(
                {(box[0] + up, box[1]), (box[0], box[1] + side)}.isdisjoint(free)
                for up in (-1, 1)
                for side in (-1, 1)
            )
            assert said["box=stuck"] == (corner and not reward)
            assert over == (said["box=goal"] or said["box=stuck"])
            assert [said[f"row<{k}"] for k in range(1, 5)] == [
                me[0] < k for k in range(1, 5)
            ]
            assert [said[f"box_column<{k}"] for k in range(1, 5)] == [
                box[1] < k for k in range(1, 5)
            ]
        won.append(reward)
    assert pushed > 80
    assert 0 < sum(won) < len(won)
    assert len(begun) > 50


def test_it_begins_wherever_it_can_be_solved() -> None:
    stage = stage_of(Setting(name="", world="neurosnap/Sokoban-v0", steps=0))
    solved = stage.fields[stage.sensors.index("box=goal")]
    assert (stage.goals == solved).all()
    far = stage.distances(solved)
    assert ((stage.start > 0) == (~stage.over & np.isfinite(far))).all()
    assert stage.falls
    assert stage.start.sum() == pytest.approx(1)


@pytest.mark.parametrize(
    ("board", "rule"),
    [
        (["..", ".."], "one G"),
        (["GG", ".."], "one G"),
        (["G.", ".x"], "one G"),
        (["G.", "."], "one length"),
        (["G.", ".."], "solvable"),
    ],
)
def test_a_board_that_is_none_is_refused(board: list[str], rule: str) -> None:
    with pytest.raises(InvalidValueError, match=rule):
        SokobanEnv(board)


def test_it_is_not_drawn() -> None:
    with pytest.raises(InvalidValueError, match="render_mode"):
        sokoban(render_mode="human")
