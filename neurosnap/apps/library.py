"""The swarm API of ``import neurosnap``: run a swarm, read its recording."""

import asyncio
from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.config.load import described, named_source
from neurosnap.apps.config.prepare import prepare
from neurosnap.apps.export.table import Cell, Table
from neurosnap.apps.new_files import free_log, new_path
from neurosnap.depth.measure import from_recording, measure
from neurosnap.depth.probe import Measured, Sweep
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.relation_table import Relation, tabulate
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.option_declaration import declared
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read import recording as read
from neurosnap.recording.read.recorded_readings import readings_of
from neurosnap.recording.read.ticks import Tick, ticks
from neurosnap.recording.replay.grown_sensors import births_of
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.recording.replay.verify import Verdict, verify
from neurosnap.runtime.anomaly_feed import Fed, recorded
from neurosnap.runtime.request import SILENT, RunRequest, Watcher
from neurosnap.runtime.run_with_restarts import resumed
from neurosnap.runtime.run_with_restarts import run as run_swarm
from neurosnap.sources.protocol import Argument

if TYPE_CHECKING:
    import networkx

T = TypeVar("T")

_KEYS = {one.field: one.shown.at for one in declared(RunOptions) if one.shown.at} | {
    "target": "agent.target",
    "grow": "agent.grow",
    "cells": "cells.kind",
    "workers": "cells.workers",
    "restart_on_error": "supervision.restart_on_error",
}
"""The keys of the TOML file by the names that `run` gives them."""


class Recording:
    """A recorded run, and what it has learned.

    Args:
        path: The file; the first of several stands for all of them.

    Raises:
        RecordingError: It is not a recording of ours, or cannot be read.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.file = read.Recording.open(self.path)
        """The recording as it is read, with its messages."""

    def __repr__(self) -> str:
        """Return how it is opened."""
        return f"Recording({str(self.path)!r})"

    @property
    def options(self) -> RunOptions:
        """The options of the recorded run."""
        return self.file.options

    @property
    def sensors(self) -> tuple[str, ...]:
        """The names of its sensors, in order."""
        return self.options.sensors

    @property
    def whole(self) -> bool:
        """Whether the recording has its end and lacks no message that was sent."""
        return self.file.whole

    def verify(self, start: int = 0) -> Verdict:
        """Derive every state and decision again, and compare bit for bit.

        Args:
            start: Begin with the last key-frame that is not after this tick.
        """
        return verify(self.path, start)

    def ticks(self) -> Iterator[Tick]:
        """Iterate over the ticks: what was read, what followed, what was decided."""
        return ticks(self.file)

    def anomalies(self, support: int | None = None) -> Iterator[Fed]:
        """Iterate over anomalies, grown sensors and alarms, in order.

        Args:
            support: The occasions an anomaly must rest on; None for the run's.
        """
        return recorded(self.file, support)

    def snapshot_at(self, tick: int | None = None) -> Snapshot:
        """Return the snapshot as learned by a tick, or by the last."""
        return snapshot_at(self.file, tick)[1]

    def order_at(self, tick: int | None = None) -> PocGraph:
        """Return the order that was learned by a tick, or by the last."""
        return self.snapshot_at(tick).poc_graph()

    def relations_at(self, tick: int | None = None) -> Sequence[Relation]:
        """Return the table of relations that was learned by a tick."""
        tick, snapshot = snapshot_at(self.file, tick)
        readings = readings_of(self.file, snapshot.sensorium, tick)
        return tabulate(readings.columns, snapshot)

    def depths(self) -> list[Measured]:
        """Return depth, height and time of every wave."""
        return from_recording(self.file)

    def to_numpy(self) -> NDArray[np.float64]:
        """Return the readings, ``(ticks, sensors)``: 1 on, 0 off, NaN unknown."""
        tick, snapshot = snapshot_at(self.file)
        columns = readings_of(self.file, snapshot.sensorium, tick).columns
        table = np.full((columns.ticks, len(columns.sensorium)), np.nan)
        for sensor in range(len(columns.sensorium)):
            known = columns.known(sensor)
            table[known, sensor] = columns.reading(sensor)[known]
        return table

    def to_pandas(self) -> Any:  # noqa: ANN401 - pandas has no types of its own
        """Return a data frame with a row for each tick, as `neurosnap export` writes.

        Raises:
            ImportError: pandas is not installed.
        """
        import pandas as pd  # type: ignore[import-untyped]

        table = Table(births_of(self.file).body)
        rows: list[list[Cell]] = [table.row(tick) for tick in self.ticks()]
        names = [column.name for column in table.columns]
        frame = pd.DataFrame(rows, columns=names)
        frame["time"] = pd.to_datetime(frame["time"], unit="ns", utc=True)
        return frame.set_index("tick")

    def to_networkx(self, tick: int | None = None) -> "networkx.DiGraph[str]":
        """Return the implications learned by a tick as a graph, literals by name.

        Raises:
            ImportError: networkx is not installed.
        """
        snapshot = self.snapshot_at(tick)
        return snapshot.poc_graph().to_networkx(snapshot.sensorium)

    def resume(
        self,
        out: Path | str | None = None,
        ticks: int | None = None,
        source: Path | str = "",
        *,
        trust_source: bool = False,
    ) -> "Recording":
        """Go on with the run after its last whole tick, in a new recording.

        Args:
            out: Where to record; None for a new file in ``logs``.
            ticks: How many ticks there are to be in all; None for 300 more.
            source: As for `run`; a world of ours and standard input need none.
            trust_source: Open what the recording names, whatever it is.
        """
        trusted = named_source(str(source)) if source else trust_source
        request = resumed(self.path, ticks, trusted)
        given = None if out is None else free_log(Path(out))
        log = given or new_path(request.options.source)
        return _carry_out(replace(request, log=log))


def run(
    source: Path | str,
    out: Path | str | None = None,
    *,
    arguments: Mapping[str, Argument] | None = None,
    settings: Mapping[str, object] | None = None,
    watcher: Watcher = SILENT,
    **options: object,
) -> Recording:
    """Run a swarm to its end, and return its recording.

    Args:
        source: The id of a world, a CSV file of readings, or a TOML file that describes
            the whole run.
        out: Where to record; None for a new file in ``logs``, or as the TOML file says.
        arguments: What the world is made with.
        settings: Other keys of the TOML file, with dots, such as ``network.listen``.
        watcher: Functions that are called meanwhile.
        **options: Options of the run by their names: ticks, seed, agent, target,
            snapshot, threshold, cells, workers, and the other fields of `RunOptions`.

    Raises:
        InvalidValueError: Something is wrong with the source or the options.
        NeurosnapError: A part failed; what was recorded until then is readable.
    """
    given: dict[str, object] = dict(settings or {})
    names: dict[str, str] = {}
    for option, value in options.items():
        if (key := _KEYS.get(option)) is None:
            rule = f"must be an option of a run: {', '.join(_KEYS)}"
            raise InvalidValueError("run", rule, option)
        given[key] = list(value) if isinstance(value, tuple) else value
        names[key] = option
    for argument, value in (arguments or {}).items():
        given[f"source.arguments.{argument}"] = value
    if out is not None:
        given["recording.path"], names["recording.path"] = str(out), "out"
    return _carry_out(prepare(described(str(source), given, names)), watcher)


def measure_depth(
    heights: Sequence[int] = (1, 2, 4, 8, 16, 32, 64),
    **more: Any,  # noqa: ANN401 - checked by `Sweep`
) -> list[Measured]:
    """Measure how far waves travel through swarms of given heights, and how long.

    Args:
        heights: How long the chains of implications are, one after another.
        **more: Other fields of `Sweep`: sensors, waves, wiring, cells and so on.

    Raises:
        InvalidValueError: A number is out of range.
    """
    sweep = Sweep(heights=tuple(heights), **more)
    return _awaited(lambda: measure(sweep, asyncio.Event()))


def _carry_out(request: RunRequest, watcher: Watcher = SILENT) -> Recording:
    """Run what was requested; return its recording."""
    if request.log is None or request.written is None:
        rule = "must be recorded to be returned"
        raise InvalidValueError("recording.record", rule, False)
    request.log.parent.mkdir(exist_ok=True)
    _awaited(lambda: run_swarm(request, asyncio.Event(), watcher))
    return Recording(request.written)


def _awaited(work: Callable[[], Coroutine[Any, Any, T]]) -> T:
    """Return what a coroutine returns, also where a loop is running already.

    In a notebook one is; another thread gets another loop.
    """
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(work())
    with ThreadPoolExecutor(1, thread_name_prefix="neurosnap/run") as pool:
        return pool.submit(lambda: asyncio.run(work())).result()
