"""Sokoban with one box, seen through binary sensors."""

from collections.abc import Sequence
from typing import Any, NamedTuple, SupportsInt

import gymnasium
from gymnasium.spaces import Discrete

from neurosnap.agent.binary_sensors import BinarySensors, Environment
from neurosnap.agent.sensor import Attribute, one_hot, thresholds
from neurosnap.errors import InvalidValueError

BOARD = (".....", "...G.", "..#..", ".....", ".....")
_MOVES = {"up": (-1, 0), "right": (0, 1), "down": (1, 0), "left": (0, -1)}


class Push(NamedTuple):
    """Where the one who pushes and the box are."""

    row: int
    """Counted from 0 at the top."""
    column: int
    """Counted from 0 at the left."""
    box_row: int
    box_column: int
    box: str
    """``goal``; ``stuck`` if it cannot be pushed any more; or ``free``."""


class SokobanEnv(gymnasium.Env[Any, Any]):
    """A board with walls, a box, and the place it is to be pushed to.

    Args:
        board: A string for each row: ``#`` a wall, ``G`` the goal, ``.`` else. What is
            around it is a wall.

    Attributes:
        states: All there are, by number.
        P: By state and action what follows, as in Gymnasium's toy texts.
        initial_state_distrib: The chance to begin in each.

    Raises:
        InvalidValueError: The board has not one goal, rows of several lengths, other
            signs, or no place to begin at.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - Gymnasium's

    def __init__(self, board: Sequence[str]) -> None:
        signs = "".join(board)
        if signs.count("G") != 1 or set(signs) - set("#G."):
            rule = "must have one G, and else only # and ."
            raise InvalidValueError("board", rule, tuple(board))
        if len({len(row) for row in board}) != 1:
            rule = "must have rows of one length"
            raise InvalidValueError("board", rule, tuple(board))
        self._signs = {
            (row, column): sign
            for row, line in enumerate(board)
            for column, sign in enumerate(line)
            if sign != "#"
        }
        pairs = [(me, box) for me in self._signs for box in self._signs if me != box]
        self.states = [Push(*me, *box, self._box(box)) for me, box in pairs]
        number = {pair: k for k, pair in enumerate(pairs)}
        self.P: dict[int, dict[int, list[tuple[float, int, float, bool]]]] = {}
        for state, pair in enumerate(pairs):
            self.P[state] = {}
            for action, way in enumerate(_MOVES.values()):
                after = number[self._moved(*pair, *way)]
                box = self.states[after].box
                won, over = float(box == "goal"), box != "free"
                self.P[state][action] = [(1.0, after, won, over)]
        starts = self._solvable()
        if not starts:
            raise InvalidValueError("board", "must be solvable", tuple(board))
        share = 1 / len(starts)
        self.initial_state_distrib = [
            share * (state in starts) for state in range(len(pairs))
        ]
        self.observation_space = Discrete(len(pairs))
        self.action_space = Discrete(len(_MOVES))
        self._state = 0

    def _box(self, box: tuple[int, int]) -> str:
        """Return what is to be said of a box there."""
        if self._signs[box] == "G":
            return "goal"
        row, column = box
        along = {(row - 1, column), (row + 1, column)} <= self._signs.keys()
        across = {(row, column - 1), (row, column + 1)} <= self._signs.keys()
        return "free" if along or across else "stuck"

    def _moved(
        self, me: tuple[int, int], box: tuple[int, int], down: int, right: int
    ) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return where both are after a move."""
        there = me[0] + down, me[1] + right
        beyond = there[0] + down, there[1] + right
        if there not in self._signs or (there == box and beyond not in self._signs):
            return me, box
        return there, beyond if there == box else box

    def _solvable(self) -> set[int]:
        """Return the states from which the box can be brought to the goal."""
        found = {k for k, state in enumerate(self.states) if state.box == "goal"}
        open_ = {k for k, state in enumerate(self.states) if state.box == "free"}
        solved = set(found)
        while more := {
            state
            for state in open_ - found
            if any(ways[0][1] in found for ways in self.P[state].values())
        }:
            found |= more
        return found - solved

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        """Begin in any state from which it can be solved."""
        super().reset(seed=seed, options=options)
        shares = self.initial_state_distrib
        self._state = int(self.np_random.choice(len(shares), p=shares))
        return self._state, {}

    def step(
        self, action: SupportsInt
    ) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Go one step, and push what is there."""
        ((_, self._state, reward, over),) = self.P[self._state][int(action)]
        return self._state, reward, over, False, {}


def sokoban(
    board: Sequence[str] = BOARD, render_mode: str | None = None
) -> BinarySensors:
    """Return Sokoban with one box.

    Description:
        A board on which a box is to be pushed to a goal. It cannot be pulled.

    Sensors:
        ``row<1``, ...; ``column<1``, ...; ``box_row<1``, ...; ``box_column<1``, ...;
        ``box=goal``, ``box=stuck``. 18 on a board of 5 times 5.

    Actions:
        ``up``, ``right``, ``down``, ``left``.

    Start:
        Any state from which it can be solved.

    Reward:
        1 with the box at the goal, 0 before.

    End:
        With the box at the goal, or where it cannot be pushed any more.

    Info:
        There is none.

    Args:
        board: See `SokobanEnv`.
        render_mode: None: it is not drawn.
    """
    if render_mode is not None:
        raise InvalidValueError("render_mode", "must be None", render_mode)
    env = SokobanEnv(board)
    rows, columns = range(1, len(board)), range(1, len(board[0]))
    sensors = (
        *thresholds("row", rows, of=Attribute("row")),
        *thresholds("column", columns, of=Attribute("column")),
        *thresholds("box_row", rows, of=Attribute("box_row")),
        *thresholds("box_column", columns, of=Attribute("box_column")),
        *one_hot("box", ("goal", "stuck"), of=Attribute("box")),
    )
    return BinarySensors(env, sensors, _on_the_board, tuple(_MOVES))


def _on_the_board(env: Environment, observation: int, _: dict[str, Any]) -> Push:
    inner: Any = env.unwrapped
    state: Push = inner.states[int(observation)]
    return state
