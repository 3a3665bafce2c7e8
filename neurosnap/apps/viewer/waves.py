"""The waves of a range of ticks, what each of them imagines, and the plans they serve.

Whether a wave has settled is found as the coordinator finds it, by the credit that came
back: a wave that was given up, or whose reports were lost, shows as one that has not.
There may be thousands of reports on a tick, so all that is done with one is to add it
up; what the coordinator refused for being impossible is left out at the end.

A recording has each planning wave with the literals it started from: an action,
and its contexts that held. So it says where the action was thought to be taken. Where
that is not the present state, it is what waves before it guaranteed: the same that the
planner took for the next imagined state (`neurosnap.agent.imagining_planner`).
"""

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from contextlib import suppress

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.imagining_planner import PlanTold, plan_told
from neurosnap.apps.viewer.api import MOST_IMAGINED, PlanView, WaveView
from neurosnap.errors import MessageError
from neurosnap.protocol.wave import DEEPEST

BEFORE = 64
"""Ticks before some others whose decisions are needed: steps of a plan that were taken
longer ago are not shown."""


class _FoundWave:
    """What was reported on one wave."""

    def __init__(self) -> None:
        self.hops: dict[int, int] = {}
        self.credit: list[int] = []
        self.pulses = 0


class Waves:
    """Waves by tick, filled with what was recorded, in any order.

    Args:
        sensors: How many there are.
    """

    def __init__(self, sensors: int) -> None:
        self._literals = range(2 * sensors)
        self._starts: dict[int, dict[int, wire.WaveStart]] = {}  # by tick, by wave
        self._found: dict[int, _FoundWave] = {}

    def begin(self, start: wire.WaveStart) -> None:
        """Take note of a wave; some are announced to many."""
        self._starts.setdefault(start.tick, {}).setdefault(start.wave, start)

    def report(self, reports: Iterable[wire.CellReport | wire.WorkerReport]) -> None:
        """Add what cells or workers reported, on whatever wave."""
        for report in reports:
            found = self._at(report.wave)
            with suppress(MessageError):  # numbers that are cut off
                found.hops.update(zip(*wire.fired(report), strict=False))
            found.credit += report.credit
            found.pulses += report.pulses

    def settled(self, tick: int, observed: tuple[int, ...]) -> bool:
        """Return whether nothing more can come of a tick's waves.

        Args:
            tick: The tick.
            observed: The literals observed at it, which start its state wave.
        """
        starts = self._of(tick)
        given_up = {start.repeats for start in starts}
        return all(
            start.wave in given_up or self._is_settled(start, observed)
            for start in starts
        )

    def reached(self, number: int) -> list[int]:
        """Return the literals that a wave reached, in no order."""
        found = self._found.get(number)
        if found is None:
            return []
        return [literal for literal in found.hops if literal in self._literals]

    def of(self, tick: int, observed: tuple[int, ...]) -> list[WaveView]:
        """Return the waves of a tick, oldest first; arguments as in `settled`."""
        return [self._shown(start, observed) for start in self._of(tick)]

    def _shown(self, start: wire.WaveStart, observed: tuple[int, ...]) -> WaveView:
        found = self._at(start.wave)
        hops = self._hops(found)
        return WaveView(
            wave=start.wave,
            kind=start.kind,
            signal=list(start.signal or observed),
            hops=hops,
            depth=hops[-1][1] if hops else 0,
            pulses=found.pulses,
            settled=self._is_settled(start, observed),
        )

    def _is_settled(self, start: wire.WaveStart, observed: tuple[int, ...]) -> bool:
        """Return whether the shares that came back are those that were given out."""
        shares = self._at(start.wave).credit
        scale = max((start.credit, *shares))
        if not shares or scale > DEEPEST:
            return False
        given = len(start.signal or observed) << (scale - start.credit)
        return sum(1 << (scale - share) for share in shares) == given

    def _hops(self, found: _FoundWave) -> list[tuple[int, int]]:
        """Return the literals reached with their hops, nearest first."""
        known = (hop for hop in found.hops.items() if hop[0] in self._literals)
        return sorted(known, key=lambda hop: (hop[1], hop[0]))

    def _of(self, tick: int) -> list[wire.WaveStart]:
        """Return the announcements of a tick's waves, oldest first."""
        starts = self._starts.get(tick, {})
        return [starts[wave] for wave in sorted(starts)]

    def _at(self, number: int) -> _FoundWave:
        if number not in self._found:
            self._found[number] = _FoundWave()
        return self._found[number]


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
        self, waves: list[WaveView], state: NDArray[np.bool_], body: Body
    ) -> list[WaveView]:
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

    def _after(self, wave: WaveView, literals: int) -> NDArray[np.bool_]:
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


def first_shown(waves: Sequence[WaveView], plan: PlanView | None) -> list[WaveView]:
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


def plan_at(
    tick: int,
    decisions: Mapping[int, wire.Decision],
    asked: Container[int],
    actions: Sequence[str],
) -> PlanView | None:
    """Return the plan that a tick's decision follows; None: it follows none.

    Args:
        tick: The tick.
        decisions: Those of the ticks around, by tick.
        asked: The ticks of planning waves: a plan that is followed asks none.
        actions: What the actions are called.
    """
    told = _told(decisions.get(tick), actions)
    if told is None:
        return None
    done: list[int] = []
    now = told
    while len(done) < BEFORE and tick not in asked:
        tick -= 1
        before = _told(decisions.get(tick), actions)
        if before is None or not _goes_on(before, now):
            break
        done.insert(0, before.actions[0])
        now = before
    return PlanView(
        steps=[*done, *told.actions],
        at=len(done),
        more=told.left - len(told.actions),
        why=told.why,
    )


def _told(decision: wire.Decision | None, actions: Sequence[str]) -> PlanTold | None:
    told = None if decision is None else plan_told(decision.why, actions)
    if told is None or decision is None or decision.action != told.actions[0]:
        return None
    return told


def _goes_on(before: PlanTold, now: PlanTold) -> bool:
    """Return whether one decision follows the same plan as the next."""
    rest = before.actions[1:]
    same = (before.left, before.why) == (now.left + 1, now.why)
    return same and rest == now.actions[: len(rest)]
