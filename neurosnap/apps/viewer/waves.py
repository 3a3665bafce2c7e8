"""The waves in a range of ticks, and the plans that planning waves serve.

Whether a wave has settled is found as the coordinator finds it, by the credit that came
back: a wave that was given up, or whose reports were lost, shows as one that has not.
There may be thousands of reports on a tick, so all that is done with one is to add it
up; what the coordinator refused for being impossible is left out at the end.

A recording has each planning wave with the literals it started from: an action,
and its contexts that held. Where these are not those of the present state, a planner
imagined the state (`neurosnap.agent.imagining_planner`).
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from operator import itemgetter

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.plan import plan_told
from neurosnap.apps.viewer.api import MOST_IMAGINED, PlanView, WaveView
from neurosnap.errors import MessageError
from neurosnap.protocol.cell_and_worker_base import DEEPEST
from neurosnap.protocol.wave_settling import fired


class _FoundWave(msgspec.Struct):
    """What was reported on one wave."""

    hops: dict[int, int] = {}
    credit: list[int] = []
    pulses: int = 0


class Waves:
    """The recorded waves of each tick; messages may be added in any order."""

    def __init__(self, sensors: int) -> None:
        self._literals = range(2 * sensors)
        self._starts: dict[int, dict[int, wire.WaveStart]] = {}  # by tick, by wave
        self._found: defaultdict[int, _FoundWave] = defaultdict(_FoundWave)

    def begin(self, start: wire.WaveStart) -> None:
        """Take note of a wave; some are announced to many."""
        self._starts.setdefault(start.tick, {}).setdefault(start.wave, start)

    def report(self, reports: Iterable[wire.CellReport | wire.WorkerReport]) -> None:
        """Add what cells or workers reported, on whatever wave."""
        for report in reports:
            found = self._found[report.wave]
            with suppress(MessageError):  # numbers that are cut off
                both = (np.asarray(each).tolist() for each in fired(report))
                found.hops.update(zip(*both, strict=False))
            found.credit += report.credit
            found.pulses += report.pulses

    def unsettled(self, tick: int, observed: tuple[int, ...]) -> list[wire.WaveStart]:
        """Return the waves of a tick of which more may be reported, oldest first.

        Args:
            tick: The tick.
            observed: The literals observed at it, which start its state wave.
        """
        starts = self._of(tick)
        given_up = {start.repeats for start in starts}
        return [
            start
            for start in starts
            if start.wave not in given_up and not self._is_settled(start, observed)
        ]

    def reached(self, number: int) -> dict[int, int]:
        """Return the literals that a wave reached, in no order, each with its hops."""
        hops = self._found[number].hops
        if not hops or max(hops) in self._literals:  # every one is of this run
            return hops
        return {a: hop for a, hop in hops.items() if a in self._literals}

    def of(self, tick: int, observed: tuple[int, ...]) -> Iterator[WaveView]:
        """Yield the waves of a tick, oldest first; arguments as in `unsettled`.

        Their hops are in no order: there may be thousands, and few are shown.
        """
        return (self._shown(start, observed) for start in self._of(tick))

    def _shown(self, start: wire.WaveStart, observed: tuple[int, ...]) -> WaveView:
        found, hops = self._found[start.wave], self.reached(start.wave)
        return WaveView(
            wave=start.wave,
            kind=start.kind,
            signal=list(start.signal or observed),
            hops=list(hops.items()),
            depth=max(hops.values(), default=0),
            pulses=found.pulses,
            settled=self._is_settled(start, observed),
        )

    def _is_settled(self, start: wire.WaveStart, observed: tuple[int, ...]) -> bool:
        """Return whether the shares that came back are those that were given out."""
        shares = self._found[start.wave].credit
        scale = max((start.credit, *shares))
        if not shares or scale > DEEPEST:
            return False
        given = len(start.signal or observed) << (scale - start.credit)
        return sum(1 << (scale - share) for share in shares) == given

    def _of(self, tick: int) -> list[wire.WaveStart]:
        """Return the announcements of a tick's waves, oldest first."""
        starts = self._starts.get(tick, {})
        return [starts[wave] for wave in sorted(starts)]


class Imagined:
    """Tells planning waves that start in the present state from imagined ones."""

    def __init__(self, body: Body) -> None:
        own, felt = len(body.own), len(body.actions) * body.senses_actions
        self._own = 2 * own
        # For each literal of an action: which; of a single context: the literal in it.
        self._action = {2 * (own + k): k for k in range(felt)}
        self._held = {2 * (own + felt + k): a for k, (_, a) in enumerate(body.context)}
        position = body.position
        self._told = np.zeros((len(body.actions), 2 * own), np.bool_)
        for action, literal in body.context:
            self._told[action, literal] = position[literal]

    def marked(self, wave: WaveView, state: NDArray[np.bool_]) -> WaveView:
        """Return a wave with the action it is about, and whether it was imagined.

        One that was comes without its hops: a search takes thousands, of which one is
        looked at. The state is that of its tick, ``(2N,)``.
        """
        taken = [self._action[a] for a in wave.signal if a in self._action]
        if wave.kind == "state" or len(taken) != 1:
            return wave
        place = np.zeros(self._own, np.bool_)
        place[[self._held[a] for a in wave.signal if a in self._held]] = True
        told = self._told[taken[0]]
        imagined = bool((told & (place ^ state[: self._own])).any())
        hops = None if imagined else wave.hops
        return msgspec.structs.replace(
            wave, action=taken[0], imagined=imagined, hops=hops
        )


def in_order(wave: WaveView) -> WaveView:
    """Return a wave with its hops, the nearest first."""
    hops = sorted(wave.hops or (), key=itemgetter(1, 0))
    return msgspec.structs.replace(wave, hops=hops)


def first_shown(waves: Sequence[WaveView]) -> list[WaveView]:
    """Return the waves of a tick that are shown: of imagined ones the oldest."""
    imagined = [wave.wave for wave in waves if wave.imagined]
    left_out = set(imagined[MOST_IMAGINED:])
    return [
        wave if wave.imagined else in_order(wave)
        for wave in waves
        if wave.wave not in left_out
    ]


def plan_of(
    decision: wire.Decision | None, actions: Sequence[str], target: Sequence[str]
) -> PlanView | None:
    """Return the plan that a decision follows; None if it follows none."""
    told = None if decision is None else plan_told(decision.why, actions)
    if told is None or decision is None or decision.action != told.actions[0]:
        return None
    more = told.left - len(told.actions)
    why = told.why or f"to achieve {', '.join(target) or 'the target'}"
    return PlanView(steps=list(told.actions), more=more, why=why)
