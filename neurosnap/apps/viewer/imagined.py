"""Tells imagined waves from those that ask what an action does here and now.

A recording has each planning wave with the literals it started from: an action,
and its contexts that held. So it says where the action was thought to be taken. Where
that is not the present state, it is what waves before it guaranteed: the same that the
planner took for the next imagined state (`neurosnap.agent.imagining`).
"""

from collections.abc import Iterable

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import guaranteed
from neurosnap.agent.body import Body
from neurosnap.apps.viewer.api import Wave


class Imagined:
    """Finds out from where a body's planning waves start.

    Args:
        body: What is sensed and done when the run starts; what is grown later says
            nothing that its members do not say.
    """

    def __init__(self, body: Body) -> None:
        own = len(body.own)
        self._own = own
        self._position = body.position[: 2 * own]
        self._choose = body.exclusive and body.senses_actions
        self._actions = range(len(body.actions))
        first = own + len(body.actions) * body.senses_actions
        # For each sensor in context: its action, and the literal of that context.
        self._context = {2 * (first + k): each for k, each in enumerate(body.context)}
        self._told = np.zeros((len(body.actions), 2 * own), np.bool_)
        for action, literal in body.context:
            self._told[action, literal] = True
        self._told &= self._position

    def followed(self, waves: list[Wave], state: NDArray[np.bool_]) -> list[Wave]:
        """Return the waves of a tick with what each imagines.

        A sensor that never changes is in every imagined state, though nothing is said
        of it: so is here what all imagined states have in common with the present one.

        Args:
            waves: Oldest first.
            state: ``(2N,)``, the tick's.
        """
        if not self._choose:
            return waves
        here = state[: 2 * self._own] & self._position
        asked = {wave.wave: self._start(wave.signal) for wave in waves}
        starts = [start for start in asked.values() if start is not None]
        always = here.copy()
        for action, place in starts:
            always &= place | ~self._told[action]
        ways: list[dict[bytes, tuple[int, ...]]] = [{} for _ in self._actions]
        self._lead(ways, here, ())
        found = []
        for wave in waves:
            start = asked[wave.wave]
            if wave.kind == "state" or start is None:
                found.append(wave)
                continue
            action, place = start
            way = ways[action].get(place.tobytes())
            steps = None if way is None else (*way, action)
            if steps is not None and wave.settled:
                self._lead(ways, self._after(wave) | always, steps)
            imagined = way != ()
            shown = None if steps is None else list(steps)
            found.append(msgspec.structs.replace(wave, steps=shown, imagined=imagined))
        return found

    def _lead(
        self,
        ways: list[dict[bytes, tuple[int, ...]]],
        place: NDArray[np.bool_],
        way: tuple[int, ...],
    ) -> None:
        """Note how a place is reached; of several ways the first is the planner's."""
        for action in self._actions:
            ways[action].setdefault((place & self._told[action]).tobytes(), way)

    def _start(self, signal: Iterable[int]) -> tuple[int, NDArray[np.bool_]] | None:
        """Return the action that a signal is about, and where it is taken."""
        first = 2 * self._own
        taken = [
            (literal - first) // 2
            for literal in signal
            if first <= literal < first + 2 * len(self._actions) and literal % 2 == 0
        ]
        if len(taken) != 1:
            return None
        place = np.zeros(2 * self._own, np.bool_)
        for literal in signal:
            action, held = self._context.get(literal, (-1, 0))
            if action == taken[0]:
                place[held] = True
        return taken[0], place & self._told[taken[0]]

    def _after(self, wave: Wave) -> NDArray[np.bool_]:
        """Return what a wave guarantees of the world: ``(2n,)``."""
        reached = np.zeros(2 * self._own, np.bool_)
        reached[[literal for literal, _ in wave.hops if literal < 2 * self._own]] = True
        place: NDArray[np.bool_] = guaranteed([reached])[0] & self._position
        return place
