"""A swarm that learns nothing: it is wired to given orders, and its waves are timed.

It conducts in the coordinator's place. What it measures is what the cells did: hops and
pulses are from their reports, the time is from the wave's start to its last credit.
"""

import time
from collections.abc import Callable, Iterator

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.depth.given_orders import GivenOrder, chain, layered
from neurosnap.errors import MessageError, SwarmError
from neurosnap.protocol.run_options import WiringKind
from neurosnap.protocol.wave import Wave
from neurosnap.protocol.wave_control import WaveControl
from neurosnap.runtime.parts.coordinator_loop import Deadlines, run_coordinator
from neurosnap.runtime.parts.job import PartContext, take_part


class Measured(msgspec.Struct, frozen=True):
    """One wave, measured."""

    sensors: int
    """Cells in the swarm."""
    wiring: str
    """Which edges carried the pulses."""
    height: int
    """Edges on the longest chain of the order."""
    depth: int
    """Hops until the last literal reached was first reached."""
    longest: int
    """Edges on the longest chain that starts in the wave's signal."""
    pulses: int
    """Pulses the wave took."""
    seconds: float
    """From the wave's start until it had settled."""
    kind: str = "signal"
    """`state` waves start in every cell at once, so nothing has to travel."""


class ProbePlan(msgspec.Struct, frozen=True):
    """What a probe does."""

    sensors: int
    """Cells in the swarm."""
    heights: tuple[int, ...]
    """One after the other, the order has this height."""
    wiring: WiringKind
    """Which edges carry the pulses."""
    waves: int
    """Waves timed at each height."""
    warmup: int = 1
    """Waves before those, not timed: the first pays for routes being made."""
    workers: int = 0
    """How many workers share the cells; 0 if every cell is a part."""
    edges: int = 0
    """0: the order is a chain on the first cells. Else a random one on all of them, of
    so many covering edges, contrapositives counted."""
    seed: int = 0
    """Draws random orders."""

    def order(self, height: int) -> GivenOrder:
        """Return the order of one height."""
        if self.edges:
            return layered(self.sensors, height, self.edges, self.seed)
        return chain(self.sensors, height, self.wiring)


class Probe:
    """The sans-I/O core; see `neurosnap.runtime.parts.coordinator_loop.Core`.

    Args:
        plan: What to do.
        clock: Seconds, for the times measured.
    """

    def __init__(
        self, plan: ProbePlan, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.finished = False
        self.rows: list[Measured] = []
        self._plan = plan
        self._clock = clock
        self._control = WaveControl(plan.sensors, workers=plan.workers)
        self._waves = self._schedule()
        self._order = GivenOrder(plan.sensors, np.empty(0, np.int64), (), 0)
        self._above = self._order.reach()
        self._timed = False
        self._began = 0.0

    @property
    def tick(self) -> int:
        """How many waves are measured."""
        return len(self.rows)

    @property
    def in_flight(self) -> tuple[int, ...]:
        """The numbers of the waves that have not settled."""
        return self._control.in_flight

    def _schedule(self) -> Iterator[tuple[GivenOrder, bool]]:
        """Yield the order of each wave to send, and whether it is timed."""
        for height in self._plan.heights:
            order = self._plan.order(height)
            for number in range(self._plan.warmup + self._plan.waves):
                yield order, number >= self._plan.warmup

    def begin(self) -> list[wire.Message]:
        """Wire the first order and send the first wave."""
        return self._next()

    def _next(self) -> list[wire.Message]:
        following = next(self._waves, None)
        if following is None:
            self.finished = True
            return []
        order, self._timed = following
        messages: list[wire.Message] = []
        if order is not self._order:
            self._order, self._above = order, order.reach()
            messages = self._control.rewire(order.edges)
        messages += self._control.start("signal", signal=order.signal)
        self._began = self._clock()
        return messages

    def receive(self, message: wire.Message) -> list[wire.Message]:
        """Take in a report; once its wave has settled, send the next.

        Raises:
            SwarmError: The wave did not reach what the order says it must.
        """
        if not isinstance(message, wire.CellReport | wire.WorkerReport):
            return []
        try:
            wave = self._control.report(message)
        except MessageError as error:
            return [wire.Fault("coordinator", str(error))]
        if wave is None:
            return []
        seconds = self._clock() - self._began
        self._check(wave)
        if self._timed:
            self.rows.append(
                Measured(
                    sensors=self._plan.sensors,
                    wiring=self._plan.wiring,
                    height=self._order.height,
                    depth=wave.depth,
                    longest=self._order.height,
                    pulses=wave.pulses,
                    seconds=seconds,
                )
            )
        return self._next()

    def _check(self, wave: Wave) -> None:
        reached = np.zeros_like(self._above)
        reached[list(wave.hops)] = True
        if not np.array_equal(reached, self._above):
            raise SwarmError(
                f"wave {wave.number}: must reach all above its signal, got"
                f" {int(reached.sum())} of {int(self._above.sum())} literals"
            )

    def overdue(self, number: int) -> list[wire.Message]:
        """Send a late wave again; its time then counts from the repeat."""
        self._began = self._clock()
        return self._control.repeat(number, ())

    def stop(self) -> list[wire.Message]:
        """End at once: a wave in flight is not worth waiting for."""
        self.finished = True
        return []


class ProbeJob(msgspec.Struct, frozen=True):
    """Conducts a swarm as a probe."""

    plan: ProbePlan
    parts: tuple[str, ...]
    """Who must be there."""

    async def run(self, part: PartContext) -> None:
        """Send every wave, and bring the rows home."""
        core, count = Probe(self.plan), len(self.parts)
        async with part.connection.fabric(swift=True) as fabric:
            await take_part(
                fabric,
                run_coordinator(
                    core,
                    fabric,
                    part.stop,
                    parts=self.parts,
                    deadlines=Deadlines(10.0 + 0.05 * count, parts=60.0 + 0.05 * count),
                    on_progress=part.reporter.progress,
                ),
            )
            part.reporter.done(core.rows)
