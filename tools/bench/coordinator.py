"""Rows on the coordinator alone: what its core takes for a tick, and for an anomaly.

Coordinator and workers are cores in this process; nothing travels. A walker goes up and
down a line of thresholds, or readings are noisy, so that each tick is an anomaly.
"""

import statistics
import time
from collections import deque

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.protocol.anomaly import AnomalyDetector
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.partition import shares
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.worker import Worker
from neurosnap.sensorium import pack
from tools.bench.report import Line, Sizes

_WORKERS = 2
_NOISE = 0.002
_TICK = 15e-3  # settled, of the middle size


def coordinator(sizes: Sizes) -> list[Line]:
    """Time ticks of the coordinator's core, settled and with noise."""
    lines = []
    for count in sizes.crowds:
        ticks = max(6, min(100, 200_000 // count))
        settled, noisy = _Cores(count, 0.0), _Cores(count, _NOISE)
        settled.go(ticks)
        noisy.go(ticks)
        # The first half is learning, and compiling.
        calm = statistics.median(settled.ticks[ticks // 2 :])
        busy = statistics.median(noisy.ticks[ticks // 2 :])
        judged = statistics.median(noisy.judged[ticks // 2 :])
        middle = count == 3000
        lines += [
            Line(
                f"a tick of the coordinator's core, {count:,} sensors, settled",
                f"{calm * 1e3:.1f} ms",
                reach=f"≤ {_TICK * 1e3:g} ms" if middle else "",
                reached=calm <= _TICK if middle else None,
                figures={"seconds": calm},
            ),
            Line(
                f"an anomaly of {count:,} sensors, {_NOISE:.1%} of the bits wrong",
                f"{judged * 1e3:.1f} ms ({judged / busy:.0%})",
                f"all that the core does in that tick {busy * 1e3:.1f} ms",
                figures={"seconds": judged, "tick_seconds": busy},
            ),
        ]
    return lines


class _Detector(AnomalyDetector):
    """A detector whose time is taken."""

    spent = 0.0

    def judge(self, *args: object, **more: object) -> wire.Anomaly | None:
        began = time.perf_counter()
        try:
            return super().judge(*args, **more)  # type: ignore[arg-type]
        finally:
            self.spent += time.perf_counter() - began


class _Cores:
    """A coordinator and its workers.

    Attributes:
        ticks: Seconds of the coordinator, for each tick.
        judged: Those of its detector.
    """

    def __init__(self, count: int, noise: float) -> None:
        names = tuple(f"x{place}" for place in range(count))
        options = RunOptions(
            source="line.csv",
            body=Body(own=names),
            ticks=1 << 30,
            watch=True,
            cells="worker",
            workers=_WORKERS,
            keyframe_every=1 << 30,
        )
        self._core = Coordinator(options)
        self._detector = _Detector(
            count, options.hold, occasions=options.support > 0, remembers=True
        )
        self._core._detector = self._detector  # noqa: SLF001 - the time it takes is wanted
        hosted = shares(count, _WORKERS)
        self._workers = [Worker(number, hosted) for number in range(_WORKERS)]
        self._rng = np.random.default_rng(1)
        self._noise, self._places, self._at = noise, np.arange(count), count // 2
        self.ticks: list[float] = []
        self.judged: list[float] = []
        self._spent = 0.0
        self._deliver(self._core.begin())

    def go(self, ticks: int) -> None:
        """Walk on."""
        for _ in range(ticks):
            self._spent = self._detector.spent = 0.0
            tick = self._core.tick + 1
            self._deliver([wire.Observation(tick=tick, bits=pack(self._step()))])
            if self._core.tick != tick:
                raise RuntimeError(f"tick: must be {tick}, got {self._core.tick}")
            self.ticks.append(self._spent)
            self.judged.append(self._detector.spent)

    def _step(self) -> NDArray[np.bool_]:
        self._at = int(
            np.clip(self._at + self._rng.integers(-1, 2), 0, len(self._places))
        )
        bits: NDArray[np.bool_] = self._places < self._at
        return bits ^ (self._rng.random(len(bits)) < self._noise)

    def _deliver(self, several: list[wire.Message]) -> None:
        """Pass messages on until nothing more is said."""
        waiting = deque(several)
        while waiting:
            match waiting.popleft():
                case wire.Observation() | wire.WaveStart() as message:
                    if isinstance(message, wire.Observation):
                        waiting += self._heard(message)
                    for worker in self._workers:
                        waiting += worker.receive([message])
                case wire.WorkerWiring(worker=to) | wire.PulseBatch(to=to) as message:
                    waiting += self._workers[to].receive([message])
                case wire.WorkerReport() as message:
                    waiting += self._heard(message)
                case _:
                    pass

    def _heard(self, message: wire.Message) -> list[wire.Message]:
        began = time.perf_counter()
        said = self._core.receive(message)
        self._spent += time.perf_counter() - began
        return said
