"""Times waves in a swarm that is wired to a given order and learns nothing.

It conducts in the coordinator's place. What it measures is what the cells did: hops and
pulses are from their reports, the time is from the wave's start to its last credit.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError, SwarmError
from neurosnap.protocol.option_declaration import option
from neurosnap.protocol.run_options import HostKind, WiringKind
from neurosnap.protocol.wave_settling import Wave
from neurosnap.protocol.wiring_and_waves import WaveControl
from neurosnap.protocol.worker_shares import shares
from neurosnap.runtime.parts.coordinator_loop import Deadlines, run_coordinator
from neurosnap.runtime.parts.job import PartContext, take_part


@dataclass(frozen=True, eq=False)
class GivenOrder:
    """An order on the literals of up to millions of sensors, and a signal in it."""

    sensors: int
    edges: NDArray[np.int64]
    """``(e,)``, ascending: what signals travel along, each edge with its
    contrapositive; source above the 32nd bit, target below."""
    signal: tuple[int, ...]
    """Literals, ascending."""
    height: int
    """Edges on the longest chain, and on the longest that starts in the signal."""

    def reach(self) -> NDArray[np.bool_]:
        """Return ``up(signal)``: ``(2N,)``. O(h e) time, for edges ``h`` hops deep."""
        sources, targets = self.edges >> 32, self.edges & 0xFFFFFFFF
        reached = np.zeros(2 * self.sensors, np.bool_)
        reached[list(self.signal)] = True
        while True:
            further = targets[reached[sources]]
            if reached[further].all():
                return reached
            reached[further] = True


def chain(sensors: int, height: int, wiring: WiringKind = "hasse") -> GivenOrder:
    """Return the chain ``0 < 2 < 4 < …`` on the first sensors; the signal is its least.

    Args:
        sensors: How many there are; more than `height`.
        height: Edges on the chain.
        wiring: ``"hasse"``: an edge from each to the next. ``"derived"``: to all above,
            as a graph derived from weights has.
    """
    below, above = np.triu_indices(height + 1, 1)
    if wiring == "hasse":
        below, above = np.arange(height), np.arange(1, height + 1)
    return GivenOrder(sensors, _closed(below, above), (0,), height)


def layered(sensors: int, height: int, edges: int, seed: int) -> GivenOrder:
    """Return a random order of `height` + 1 layers; the signal is the lowest.

    Every sensor that is not in the lowest layer is above one of the next lower, at
    least. Edges lead from a layer to the next, so each is a cover: nothing is between.

    Args:
        sensors: How many there are. Which is in which layer is drawn, so that their
            numbers say nothing of it.
        height: At least 1.
        edges: How many there are, contrapositives counted.
        seed: Draws the order.

    Raises:
        InvalidValueError: There is no such order.
    """
    check_layers(sensors, height, edges)
    draw = np.random.default_rng(seed)
    drawn = draw.permutation(sensors)
    layers = [drawn[layer.start : layer.stop] for layer in shares(sensors, height + 1)]
    covers = [draw.choice(a, len(b)) << 32 | b for a, b in pairwise(layers)]
    rooms = np.array([len(a) * len(b) for a, b in pairwise(layers)])
    found = np.sort(np.concatenate(covers))
    while len(found) < edges // 2:
        counts = draw.multinomial(edges // 2 - len(found), rooms / rooms.sum())
        more = [
            draw.choice(a, count) << 32 | draw.choice(b, count)
            for count, (a, b) in zip(counts, pairwise(layers), strict=True)
        ]
        found = np.union1d(found, np.concatenate(more))
    signal = tuple(np.sort(2 * layers[0]).tolist())
    return GivenOrder(sensors, _closed(found >> 32, found & 0xFFFFFFFF), signal, height)


def check_layers(sensors: int, height: int, edges: int) -> None:
    """Raise InvalidValueError if there is no order for `layered` to draw."""
    if not 1 <= height < sensors:
        rule = f"must be at least 1 and below the sensors, {sensors}"
        raise InvalidValueError("height", rule, height)
    sizes = [len(layer) for layer in shares(sensors, height + 1)]
    least = 2 * (sensors - sizes[0])
    most = 2 * sum(low * high for low, high in pairwise(sizes))
    if edges % 2 or not least <= edges <= most:
        raise InvalidValueError("edges", f"must be even, {least} to {most}", edges)


def _closed(below: NDArray[np.int64], above: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return edges between sensors' own literals, and their contrapositives."""
    own = 2 * below << 32 | 2 * above
    contrapositive = 2 * above + 1 << 32 | 2 * below + 1
    return np.sort(np.concatenate((own, contrapositive)))


class Measured(msgspec.Struct, frozen=True):
    """The measured time and depth of one wave."""

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


class Sweep(msgspec.Struct, frozen=True, kw_only=True):
    """Which waves to measure: one swarm for each number of sensors.

    In each the order has one height after the other, and a wave starts at its bottom.
    """

    heights: tuple[int, ...]
    """Edges on the longest chain, one after another."""
    sensors: tuple[int, ...] = ()
    """Cells in each swarm; empty: what the longest chain takes, and twice as many. If
    only height counts, both take as long."""
    wiring: Annotated[
        WiringKind,
        option(
            "Which implications are connections between cells. Hasse: only those that do"
            " not follow from others. Derived: all."
        ),
    ] = "hasse"
    waves: Annotated[int, option("How many waves to start at each height.")] = 10
    cells: Annotated[
        HostKind,
        option(
            "Where the cells are. Process: each cell is a process of its own. Worker: a"
            " few processes share them."
        ),
    ] = "process"
    workers: Annotated[
        int, option("With cells in workers: how many processes share them.", ge=1)
    ] = 2
    edges: Annotated[
        int,
        option(
            "Measure random orders with so many implications instead of chains.",
            default="0: chains",
        ),
    ] = 0
    seed: Annotated[int, option("Seed of the random orders.")] = 0
    warmup: int = 1
    """Waves before those, not timed: the first pays for routes being made."""

    def __post_init__(self) -> None:
        heights = self.heights
        if not heights or min(heights) < 0 or not any(heights):
            rule = "must be numbers from 0 up, one of them at least 1"
            raise InvalidValueError("heights", rule, list(heights))
        if min(self.sizes) <= max(heights):
            rule = f"must be more than the largest height, {max(heights)}"
            raise InvalidValueError("sensors", rule, list(self.sizes))
        if self.waves < 1:
            raise InvalidValueError("waves", "must be at least 1", self.waves)
        if self.edges and self.wiring != "hasse":
            rule = 'must be "hasse" for a random order'
            raise InvalidValueError("wiring", rule, self.wiring)
        for count in self.sizes:
            if self.cells == "worker":
                shares(count, self.workers)
            for height in heights if self.edges else ():
                check_layers(count, height, self.edges)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Cells in each swarm."""
        least = max(self.heights) + 1
        return self.sensors or (least, 2 * least)

    @property
    def sharing(self) -> int:
        """How many workers share the cells; 0 if every cell is a part."""
        return self.workers if self.cells == "worker" else 0

    @property
    def total(self) -> int:
        """How many waves are timed."""
        return len(self.sizes) * len(self.heights) * self.waves

    def order(self, sensors: int, height: int) -> GivenOrder:
        """Return the order of one height in a swarm of so many cells."""
        if self.edges:
            return layered(sensors, height, self.edges, self.seed)
        return chain(sensors, height, self.wiring)


class Probe:
    """The pure core of a probe; see `neurosnap.runtime.parts.coordinator_loop.Core`.

    Args:
        sweep: What to do.
        sensors: Cells in the swarm.
        clock: Seconds, for the times measured.
    """

    def __init__(
        self,
        sweep: Sweep,
        sensors: int,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.finished = False
        self.rows: list[Measured] = []
        self._sweep = sweep
        self._sensors = sensors
        self._clock = clock
        self._control = WaveControl(sensors, workers=sweep.sharing)
        self._waves = self._schedule()
        self._order = GivenOrder(sensors, np.empty(0, np.int64), (), 0)
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
        sweep = self._sweep
        for height in sweep.heights:
            order = sweep.order(self._sensors, height)
            for number in range(sweep.warmup + sweep.waves):
                yield order, number >= sweep.warmup

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
                    sensors=self._sensors,
                    wiring=self._sweep.wiring,
                    height=self._order.height,
                    depth=wave.depth,
                    longest=self._order.height,
                    pulses=wave.pulses,
                    seconds=seconds,
                )
            )
        return self._next()

    def _check(self, wave: Wave) -> None:
        if not np.array_equal(wave.reached, self._above):
            raise SwarmError(
                f"wave {wave.number}: must reach all above its signal, got"
                f" {int(wave.reached.sum())} of {int(self._above.sum())} literals"
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
    """The job of the coordinator of a probe."""

    sweep: Sweep
    sensors: int
    """Cells in the swarm."""
    parts: tuple[str, ...]
    """Who must be there."""

    async def run(self, part: PartContext) -> None:
        """Send every wave, and bring the rows home."""
        core, count = Probe(self.sweep, self.sensors), len(self.parts)
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
