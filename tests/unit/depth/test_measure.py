"""Depth against height: the fit, its output files, and the probe."""

import asyncio
import csv
import itertools
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import pytest

from neurosnap import wire
from neurosnap.depth.measure import COLUMNS, FittedLine, draw, fit, measure, write_csv
from neurosnap.depth.probe import Measured, Probe, Sweep
from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.fabric.in_memory import MemoryFabric, MemoryHub
from neurosnap.poc.order.graph import WiringKind
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_shares import hosts, shares
from tests.support.memory_hubs import run_out
from tools.simulate.simulated_hub import SimulatedHub


def row(
    depth: int, seconds: float, *, kind: str = "signal", sensors: int = 9
) -> Measured:
    return Measured(
        sensors=sensors,
        wiring="hasse",
        height=depth,
        depth=depth,
        longest=depth,
        pulses=depth,
        seconds=seconds,
        kind=kind,
    )


def on_a_line(*depths: int) -> list[Measured]:
    """Return rows that take a quarter of a second, and an eighth more a hop."""
    return [row(depth, 0.25 + 0.125 * depth) for depth in depths]


# Fitting ------------------------------------------------------------------------------


STATES = [row(0, 100.0, kind="state"), row(9, -100.0, kind="state")]


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        pytest.param(on_a_line(1, 2, 4, 8, 16), (0.125, 0.25, 1), id="exact"),
        # Means 1 and 3, so half of the variance is within a depth.
        pytest.param(
            [row(0, 0.0), row(0, 2.0), row(2, 2.0), row(2, 4.0)],
            (1, 1, 0.5),
            id="noise",
        ),
        pytest.param([row(d, 0.5) for d in (1, 2, 3)], (0, 0.5, 1), id="level"),
        pytest.param(
            [*STATES, *on_a_line(1, 2, 3)], (0.125, 0.25, 1), id="without states"
        ),
        pytest.param([*STATES, *on_a_line(2)], None, id="but for states one depth"),
        pytest.param([], None, id="no depth"),
        pytest.param(on_a_line(3, 3, 3), None, id="one depth"),
    ],
)
def test_a_line_is_fitted(
    rows: list[Measured], expected: tuple[float, float, float] | None
) -> None:
    line = fit(rows)
    found = None if line is None else msgspec.structs.astuple(line)
    assert found == (expected and pytest.approx(expected, abs=1e-12))


@pytest.mark.parametrize(
    ("r2", "words"),
    [(0.5, "3 µs a hop, R² 0.500"), (0.499, "no line fits, R² 0.499")],
)
def test_a_line_that_does_not_explain_half_has_no_slope(r2: float, words: str) -> None:
    line = FittedLine(3e-6, 0.0, r2)
    assert line.words == words
    assert line.explains == ("hop" in words)


# Writing ------------------------------------------------------------------------------


def test_a_csv_has_a_row_a_wave(tmp_path: Path) -> None:
    rows = [*on_a_line(1, 2), row(0, 0.1, kind="state")]
    path = tmp_path / "depth.csv"
    path.write_text("what was there before")
    write_csv(rows, path)
    assert path.read_text().splitlines()[0] == (
        "sensors,wiring,height,depth,longest,pulses,seconds"
    )
    with path.open(newline="") as file:
        read = list(csv.reader(file))
    assert read[1:] == [[str(getattr(r, name)) for name in COLUMNS] for r in rows]
    assert [float(line[-1]) for line in read[1:]] == [r.seconds for r in rows]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow  # the first figure of a process loads matplotlib
@pytest.mark.parametrize(
    "rows",
    [
        [*on_a_line(1, 2, 4), *(row(d, 0.2 * d, sensors=18) for d in (1, 2, 4))],
        on_a_line(3, 3),
        on_a_line(0),
        [row(0, 0.1, kind="state")],
        [*on_a_line(1, 2), row(0, 0.1, kind="state")],
    ],
    ids=["two groups", "one depth", "no depth", "state waves only", "both kinds"],
)
def test_a_figure_is_drawn_whole(tmp_path: Path, rows: list[Measured]) -> None:
    paths = draw(rows, tmp_path, "a.mcap")
    assert set(tmp_path.iterdir()) == set(paths)
    png, svg, pdf = (path.read_bytes() for path in paths)
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    assert b"IEND" in png[-12:]
    assert svg.rstrip().endswith(b"</svg>")
    assert pdf.rstrip().endswith(b"%%EOF")
    assert min(map(len, (png, svg, pdf))) > 5000


@pytest.mark.parametrize(
    ("given", "text"),
    [
        *(
            ({"heights": wrong}, "heights: must be numbers from 0 up, one of them at")
            for wrong in ((), (-1, 2), (0,))
        ),
        ({"sensors": (3, 2)}, "sensors: must be more than the largest height, 2, got"),
        ({"waves": 0}, "waves: must be at least 1, got 0"),
        ({"cells": "worker", "workers": 0}, "workers: must be at least 1 and at most"),
        ({"cells": "worker", "workers": 4}, "workers: must be at least 1 and at most"),
        ({"edges": 3}, "edges: must be even, 4 to 4, got 3"),
        ({"edges": 4, "wiring": "derived"}, 'wiring: must be "hasse" for a random'),
    ],
)
def test_what_cannot_be_measured_is_refused(given: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(text)}"):
        Sweep(**{"heights": (2,), "sensors": (3,), "waves": 1, **given})


async def test_a_stop_before_the_first_swarm_measures_nothing() -> None:
    stop = asyncio.Event()
    stop.set()
    assert await measure(Sweep(heights=(1,), sensors=(2,), waves=1), stop) == []


# The probe ----------------------------------------------------------------------------

Lost = Callable[[wire.Message], bool]


def swarm(
    sensors: int, heights: tuple[int, ...], workers: int = 0, **more: Any
) -> Sweep:
    """Return a sweep of one swarm."""
    if workers:
        more |= {"cells": "worker", "workers": workers}
    return Sweep(heights=heights, sensors=(sensors,), **more)


def probed(
    sweep: Sweep, seed: int | None = None, lost: Lost = lambda _: False
) -> Probe:
    """Let a probe conduct cells or workers over a hub without a loop, to its end.

    Its clock goes on by one second each time it is read. A wave that is stuck since
    `lost` took a message from it is declared late.
    """
    seconds = itertools.count(1)
    (count,) = sweep.sizes
    probe = Probe(sweep, count, clock=lambda: float(next(seconds)))
    hub = MemoryHub() if seed is None else SimulatedHub(seed)
    conducting = hub.fabric("coordinator")

    def say(messages: list[wire.Message]) -> None:
        for message in messages:
            conducting.publish(message)

    def hear(deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            say(probe.receive(wire.decode(delivery.key, delivery.payload)))

    def join(core: Cell | Worker, end: MemoryFabric, keys: Sequence[str]) -> None:
        def handle(deliveries: list[wire.Delivery]) -> None:
            burst = [wire.decode(d.key, d.payload) for d in deliveries]
            for message in core.receive([m for m in burst if not lost(m)]):
                end.publish(message)

        end.listen(keys, handle)

    conducting.listen(("cellreport/**", "workerreport/**"), hear)
    for number, who in enumerate(hosts(count, sweep.sharing)):
        if sweep.sharing:
            worker = Worker(number, shares(count, sweep.sharing))
            join(worker, hub.fabric(who), wire.worker_keys(number, learns=False))
        else:
            join(Cell(number), hub.fabric(who), wire.cell_keys(number))
    say(probe.begin())
    while run_out(hub) or not probe.finished:
        for number in probe.in_flight:
            say(probe.overdue(number))
    return probe


HEIGHTS = (0, 1, 2, 5, 11)


@pytest.mark.parametrize("seed", [None, 0, 1])
@pytest.mark.parametrize(
    ("wiring", "workers"),
    [("hasse", 0), ("hasse", 1), ("hasse", 5), ("derived", 0), ("derived", 1)],
)
def test_a_wave_is_as_deep_as_the_chain_or_takes_one_hop_over_derived_edges(
    wiring: WiringKind, workers: int, seed: int | None
) -> None:
    if (wiring, workers) == ("derived", 0):
        seed = None  # out of order it is deeper
    rows = probed(swarm(12, HEIGHTS, workers, wiring=wiring, waves=3), seed).rows
    assert [row.height for row in rows] == [h for h in HEIGHTS for _ in range(3)]
    for row in rows:
        h = row.height
        assert row.longest == h
        assert (row.sensors, row.wiring, row.kind) == (12, wiring, "signal")
        # One along each edge; over derived ones from each to all above.
        expected = (h, h) if wiring == "hasse" else (min(h, 1), h * (h + 1) // 2)
        assert (row.depth, row.pulses) == expected


@pytest.mark.parametrize("seed", range(2))
def test_out_of_order_a_derived_wave_is_deeper_and_reaches_the_same(seed: int) -> None:
    rows = probed(swarm(12, (11,), wiring="derived", waves=4), seed).rows
    assert len(rows) == 4
    assert all(1 <= measured.depth <= 11 for measured in rows)
    assert all(measured.pulses == 66 for measured in rows)
    assert any(measured.depth > 1 for measured in rows)


def test_waves_to_warm_up_are_not_in_the_rows() -> None:
    plan = swarm(4, (2, 3), waves=2, warmup=3)
    numbers = set()

    def count(message: wire.Message) -> bool:
        if isinstance(message, wire.WaveStart):
            numbers.add(message.wave)
        return False

    probe = probed(plan, lost=count)
    assert len(numbers) == 2 * (2 + 3)
    assert probe.tick == len(probe.rows) == 2 * 2


def test_a_wave_that_lost_a_pulse_is_sent_again_and_measured_right() -> None:
    left = [True]

    def lost(message: wire.Message) -> bool:
        return isinstance(message, wire.Pulse) and bool(left) and left.pop()

    rows = probed(swarm(4, (3,), waves=2, warmup=0), lost=lost).rows
    assert not left
    assert [(r.depth, r.pulses, r.seconds) for r in rows] == [(3, 3, 1.0)] * 2


def test_a_wave_that_reaches_less_than_the_order_says_is_an_error() -> None:
    probe = Probe(swarm(3, (2,), waves=1), 3)
    start = probe.begin()[-1]
    assert isinstance(start, wire.WaveStart)
    lie = wire.CellReport(start.wave, 0, 0, (0,), (0,), (start.credit,), 0, epoch=1)
    rule = r"^wave 1: must reach all above its signal, got 1 of 3 literals$"
    with pytest.raises(SwarmError, match=rule):
        probe.receive(lie)


def test_a_report_that_cannot_be_right_is_a_fault() -> None:
    probe = Probe(swarm(3, (2,), waves=1), 3)
    probe.begin()
    twice = wire.CellReport(1, 0, 0, (0,), (0,), (0, 0), 0)
    (fault,) = probe.receive(twice)
    assert isinstance(fault, wire.Fault)
    assert not probe.finished
    assert probe.receive(wire.Observation(1, b"\x00")) == []
    assert probe.stop() == []
    assert probe.finished


@pytest.mark.parametrize("workers", [0, 1, 3])
def test_a_wave_through_a_random_order_fires_every_cell(workers: int) -> None:
    plan = swarm(30, (4, 9), workers, waves=2, edges=90, seed=3)
    rows = probed(plan, seed=8).rows
    assert [row.depth for row in rows] == [row.longest for row in rows] == [4, 4, 9, 9]
    assert {row.pulses for row in rows} == {45}  # along half of the edges


def test_workers_that_were_cut_off_get_their_wiring_whole() -> None:
    cut = []

    def lost(message: wire.Message) -> bool:
        match message:
            case wire.WorkerWiring(worker=0, epoch=1) | wire.WaveStart(wave=1):
                cut.append(message)
                return True
        return False

    plan = swarm(6, (2, 5), 2, waves=2)
    rows = probed(plan, lost=lost).rows
    assert len(cut) == 1 + 2
    assert [(row.depth, row.pulses) for row in rows] == [(2, 2)] * 2 + [(5, 5)] * 2
