"""The excitation-driven agent: moves to better states, or at least not to worse ones.

Its target is one sensation, so it needs no plan: it takes an action that guarantees
`better`; failing that, one that guarantees `worse*`, now and then a random one; failing
that, a random one.

References:
    [GK] "Closing the Loop: Excitation-Driven Navigation".
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.policy import EXPLORE, Deliberation, checked_share
from neurosnap.agent.random_numbers import RandomNumbers
from neurosnap.errors import InvalidValueError
from neurosnap.system.compiled import njit

SEEKS: Final = 0
KEEPS: Final = 1
EXPLORES: Final = 2
LOST: Final = 3

_WHY = {
    SEEKS: "guarantees better",
    KEEPS: "guarantees worse*; nothing guarantees better",
    EXPLORES: "at random, to explore; nothing guarantees better",
    LOST: "at random: nothing guarantees better or worse*",
}


class Excited:
    """Decides by excitation.

    Args:
        body: Its sensors include `better` and `worse`.
        seed: Draws among equals, and when to explore.
        explore: The share of random actions where the best that can be guaranteed is
            `worse*`, in [0, 1].

    Raises:
        InvalidValueError: The body has no such sensors or no actions, or `explore` is
            out of range.
    """

    def __init__(self, body: Body, seed: int, explore: float = EXPLORE) -> None:
        self._actions = Actions(body)
        self._better, self._not_worse = drives(body)
        self._explore = checked_share(explore)
        self._random = RandomNumbers(seed)

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Ask for the consequences of every action, and take the best.

        Args:
            tick: The tick whose state is known.
            state: ``(2N,)``, the coherent state.
        """
        closures = yield self._actions.signals(state)
        bound = guaranteed(closures)
        action, why = choose(
            self._actions.admissible(closures),
            bound[:, self._better],
            bound[:, self._not_worse],
            self._explore,
            self._random.at(tick),
        )
        return int(action), _WHY[int(why)]

    def grow(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        self._actions = Actions(body)


def drives(body: Body) -> tuple[int, int]:
    """Return the literals `better` and `worse*` of a body.

    Raises:
        InvalidValueError: Its world has no such sensors.
    """
    if not {"better", "worse"}.issubset(body.own):
        rule = "must have a world with the sensors better and worse"
        raise InvalidValueError("agent excited", rule, list(body.own))
    return 2 * body.own.index("better"), 2 * body.own.index("worse") + 1


@njit()
def choose(
    possible: NDArray[np.bool_],
    better: NDArray[np.bool_],
    not_worse: NDArray[np.bool_],
    explore: float,
    draws: NDArray[np.float64],
) -> tuple[int, int]:
    """Return an action and why: `SEEKS`, `KEEPS`, `EXPLORES` or `LOST`.

    Compiled, since experiments run the whole agent in one loop.

    Args:
        possible: ``(actions,)``: it can be taken.
        better: ``(actions,)``: it guarantees `better`.
        not_worse: ``(actions,)``: it guarantees `worse*`.
        explore: The share of random actions.
        draws: ``(WIDTH,)``, the tick's numbers.
    """
    options, why = possible & better, SEEKS
    if not options.any():
        options, why = possible & not_worse, KEEPS
        if not options.any():
            options, why = possible, LOST
        elif draws[1] < explore:
            options, why = possible, EXPLORES
    chosen = int(draws[0] * options.sum())
    for action in range(options.shape[0]):
        if options[action]:
            if chosen == 0:
                return action, why
            chosen -= 1
    return 0, LOST  # never: somewhere an option is left
