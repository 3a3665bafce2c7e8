"""A worker answers what the cells it stands for would."""

from collections import deque
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from tests.support.wave_messages import share, start
from tests.support.worker_messages import (
    HOSTED,
    ME,
    SENSORS,
    burst,
    fired_in,
    pulses_in,
    wired,
)

literals = st.integers(0, 2 * SENSORS - 1)


class Cells:
    """The cells of one worker, which pass on among themselves, first come, first."""

    def __init__(self, pairs: Sequence[tuple[int, int]]) -> None:
        self.cells = {number: Cell(number) for number in HOSTED[ME]}
        for number, cell in self.cells.items():
            add, more = (
                tuple(sorted(b for a, b in pairs if a == literal))
                for literal in (2 * number, 2 * number + 1)
            )
            cell.receive([wire.Wiring(number, 1, 0, add=add, add_complement=more)])

    def receive(self, said: Sequence[wire.Message]) -> list[wire.Message]:
        """Return what leaves, and the reports."""
        out: list[wire.Message] = []
        waiting = deque(
            (cell, message)
            for message in said
            for cell in self.cells.values()
            if not isinstance(message, wire.Pulse) or message.target >> 1 == cell.cell
        )
        while waiting:
            cell, message = waiting.popleft()
            for answer in cell.receive([message]):
                inside = isinstance(answer, wire.Pulse) and (
                    answer.target >> 1 in self.cells
                )
                if inside and isinstance(answer, wire.Pulse):
                    waiting.append((self.cells[answer.target >> 1], answer))
                else:
                    out.append(answer)
        return out


def summed(messages: Iterable[wire.Message]) -> dict[str, Any]:
    """What was said of a wave, whoever said it in whatever messages."""
    hops: dict[int, int] = {}
    leaving, back, pulses = [], Fraction(0), 0
    for message in messages:
        match message:
            case wire.Pulse():
                leaving.append(
                    (message.source, message.target, message.hops, message.credit)
                )
            case wire.PulseBatch():
                leaving += pulses_in(message)
            case wire.CellReport():
                hops |= zip(message.literals, message.hops, strict=True)
            case wire.WorkerReport():
                hops |= fired_in(message)
        if isinstance(message, wire.CellReport | wire.WorkerReport):
            back += sum(map(share, message.credit))
            pulses += message.pulses
    return {"hops": hops, "leaving": sorted(leaving), "back": back, "pulses": pulses}


@given(
    pairs=st.lists(st.tuples(st.integers(6, 11), literals), max_size=25, unique=True),
    signal=st.lists(literals, max_size=4, unique=True),
    coming=st.lists(
        st.tuples(st.integers(0, 5), st.integers(6, 11), st.integers(2, 4)),
        max_size=6,
        unique_by=lambda pulse: pulse[:2],
    ),
)
def test_it_says_what_its_cells_would(
    pairs: list[tuple[int, int]],
    signal: list[int],
    coming: list[tuple[int, int, int]],
) -> None:
    # One after the other, and with hops that make the first also the shortest way: then
    # nothing is left to chance, neither among cells nor in a worker.
    worker, cells = wired(*pairs), Cells(pairs)
    begin = start(1, *sorted(signal), credit=4)
    assert summed(worker.receive([begin])) == summed(cells.receive([begin]))
    for part, (source, target, credit) in enumerate(coming):
        hops = 20 * (part + 1)
        one = burst((source, target, hops, credit), part=part)
        same = wire.Pulse(1, source, target, hops, credit, 1)
        assert summed(worker.receive([one])) == summed(cells.receive([same]))


@given(
    pairs=st.lists(st.tuples(st.integers(6, 11), literals), max_size=25, unique=True),
    signal=st.lists(st.integers(6, 11), max_size=4, unique=True),
    coming=st.lists(
        st.tuples(
            st.integers(0, 5), st.integers(6, 11), st.integers(1, 9), st.integers(2, 90)
        ),
        max_size=12,
    ),
)
def test_it_takes_the_shortest_ways_and_keeps_the_credit(
    pairs: list[tuple[int, int]],
    signal: list[int],
    coming: list[tuple[int, int, int, int]],
) -> None:
    said: list[wire.Message] = [
        start(1, *signal, credit=2),
        *([burst(*coming)] if coming else []),
    ]
    found = summed(wired(*pairs).receive(said))
    # Relaxing every edge as often as there are literals gives the shortest ways.
    hops = dict.fromkeys(signal, 0)
    for _, target, far, _ in sorted(coming, key=lambda pulse: -pulse[2]):
        hops[target] = min(far, hops.get(target, far))
    for _ in range(2 * SENSORS):
        for a, b in pairs:
            if a in hops and 6 <= b <= 11:
                hops[b] = min(hops.get(b, hops[a] + 1), hops[a] + 1)
    assert found["hops"] == hops
    assert found["pulses"] == sum(a in hops for a, _ in pairs)
    outside = [(a, b, hops[a] + 1) for a, b in pairs if a in hops and not 6 <= b <= 11]
    assert [pulse[:3] for pulse in found["leaving"]] == sorted(outside)
    came = len(signal) * share(2) + sum(share(credit) for *_, credit in coming)
    left = sum(share(credit) for *_, credit in found["leaving"])
    if came <= 1:
        assert left + found["back"] == came


def test_a_literal_named_twice_fires_once_as_it_does_in_a_cell() -> None:
    begin: wire.Message = start(1, 6, 6, 6, credit=3)
    said = wired((6, 0)).receive([begin])
    assert summed(said) == summed(Cells([(6, 0)]).receive([begin]))
