"""Tells imagined waves from those that ask what an action does here and now.

A recording has each planning wave with the literals it started from: an action,
and its contexts that held. So it says where the action was thought to be taken. Where
that is not the present state, it is what waves before it guaranteed: the same that the
planner took for the next imagined state (`neurosnap.agent.imagining`).
"""

from collections import Counter
from collections.abc import Iterable, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.apps.viewer.api import MOST_IMAGINED, Plan, Wave


class Imagined:
    """Finds out from where a body's planning waves start.

    Args:
        body: What is sensed and done when the run starts.
    """

    def __init__(self, body: Body) -> None:
        own, felt = len(body.own), len(body.actions) * body.senses_actions
        self._own = 2 * own
        self._position = body.position[: 2 * own]
        self._acts = body.exclusive and felt > 0
        # For each literal of an action: which; of a single context: the literal in it.
        self._action = {2 * (own + k): k for k in range(felt)}
        self._held = {2 * (own + felt + k): a for k, (_, a) in enumerate(body.context)}
        self._told = np.zeros((len(body.actions), 2 * own), np.bool_)
        for action, literal in body.context:
            self._told[action, literal] = self._position[literal]

    def followed(
        self, waves: list[Wave], state: NDArray[np.bool_], body: Body
    ) -> list[Wave]:
        """Return the waves of a tick with what each imagines.

        A sensor that never changes is in every imagined state, though nothing is said
        of it: so is here what all imagined states have in common with the present one.

        Args:
            waves: Oldest first.
            state: ``(2N,)``, the tick's.
            body: What was sensed at the tick.
        """
        if not self._acts or all(wave.kind == "state" for wave in waves):
            return waves
        here = state[: self._own] & self._position
        starts = [self._start(wave.signal) for wave in waves]
        always = np.zeros_like(state)
        always[: self._own] = here
        for start in starts:
            if start is not None:
                always[: self._own] &= start[1] | ~self._told[start[0]]
        ways = _Ways(body)
        ways.lead(state, ())
        found = []
        for wave, start in zip(waves, starts, strict=True):
            if wave.kind == "state" or start is None:
                found.append(wave)
                continue
            action, place = start
            way = ways.to(wave.signal)
            steps = None if way is None else [*way, action]
            if steps is not None and wave.settled:
                ways.lead(self._after(wave, len(state)) | always, tuple(steps))
            elsewhere = bool((place != here & self._told[action]).any())
            found.append(
                msgspec.structs.replace(
                    wave,
                    steps=steps,
                    imagined=elsewhere if way is None else bool(way),
                )
            )
        return found

    def _start(self, signal: Iterable[int]) -> tuple[int, NDArray[np.bool_]] | None:
        """Return the action a signal is about, and where it is taken: ``(2n,)``."""
        taken = [self._action[a] for a in signal if a in self._action]
        if len(taken) != 1:
            return None
        place = np.zeros(self._own, np.bool_)
        place[[self._held[a] for a in signal if a in self._held]] = True
        return taken[0], place & self._told[taken[0]]

    def _after(self, wave: Wave, literals: int) -> NDArray[np.bool_]:
        """Return what a wave guarantees: ``(2N,)``."""
        reached = np.zeros(literals, np.bool_)
        reached[[literal for literal, _ in wave.hops]] = True
        bound: NDArray[np.bool_] = guaranteed([reached])[0]
        return bound


class _Ways:
    """How imagined states are reached, by the signals that start in them.

    Args:
        body: What is sensed.
    """

    def __init__(self, body: Body) -> None:
        self._actions = Actions(body)
        self._looked_at = body.looked_at
        self._seen: set[bytes] = set()
        self._found: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
        self._asked = Counter[tuple[int, ...]]()

    def lead(self, state: NDArray[np.bool_], way: tuple[int, ...]) -> None:
        """Note how a state, ``(2N,)``, is reached; the first way is the planner's."""
        state = state & self._looked_at
        if (key := state.tobytes()) in self._seen:
            return
        self._seen.add(key)
        for signal in self._actions.signals(state):
            self._found.setdefault(tuple(sorted(signal)), []).append(way)

    def to(self, signal: Iterable[int]) -> tuple[int, ...] | None:
        """Return how the state is reached in which a signal starts; None: not known.

        States that differ in what another action's sensors look at start the same
        signal. The planner asks for each, in the order in which it came to them.
        """
        key = tuple(sorted(signal))
        ways, asked = self._found.get(key, []), self._asked[key]
        self._asked[key] += 1
        return ways[min(asked, len(ways) - 1)] if ways else None


def first_shown(waves: Sequence[Wave], plan: Plan | None) -> list[Wave]:
    """Return the waves of a tick that are shown first, in their order.

    Of the imagined ones there are at most `MOST_IMAGINED`: those that lead along the
    plan, then the oldest.
    """
    ahead = [] if plan is None else plan.steps[plan.at :]
    imagined = [place for place, wave in enumerate(waves) if wave.imagined]

    def strays(place: int) -> bool:
        steps = waves[place].steps
        return steps is None or steps != ahead[: len(steps)]

    left_out = set(sorted(imagined, key=strays)[MOST_IMAGINED:])
    return [wave for place, wave in enumerate(waves) if place not in left_out]
