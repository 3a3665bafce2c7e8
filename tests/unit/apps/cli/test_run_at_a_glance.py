"""The rows on a terminal say what a run is at, what it lacks, and what it found."""

from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.apps.cli.run_at_a_glance import Glance
from neurosnap.protocol.tick_times import Behind
from neurosnap.protocol.worker_shares import hosts
from neurosnap.runtime.parts.job import WavesSoFar
from neurosnap.sources.live.journal import Journal, JournalRow, Taken, journal_of


class Clock:
    """A clock that is set by hand."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def rows(glance: Glance) -> dict[str, str]:
    return dict(glance.rows())


def waves(tick: int, number: int = 0, **more: object) -> WavesSoFar:
    return msgspec.structs.replace(WavesSoFar(tick, number or 2 * tick), **more)


def test_rates_are_those_of_the_last_seconds_and_fall_once_no_tick_comes(
    clock: Clock,
) -> None:
    glance = Glance(1000, clock=clock)
    assert rows(glance) == {"ticks": "none yet"}
    for tick in range(1, 101):  # the first half eight times as slowly
        clock.now += 1.0 if tick <= 50 else 0.125
        glance.waves(waves(tick))
    assert rows(glance)["ticks"] == "100 of 1,000; 8 a second, 1 min left"
    assert rows(glance)["waves"] == "16 a second"
    clock.now += 5
    assert rows(glance)["ticks"] == "100 of 1,000; 4 a second, 3 min left"
    assert rows(glance)["silent"] == "5 s since the last tick"


def test_a_run_that_goes_on_from_an_earlier_tick_has_no_negative_rate(
    clock: Clock,
) -> None:
    glance = Glance(clock=clock)
    for tick in (90, 40, 50):
        glance.waves(waves(tick))
        clock.now += 1
    assert rows(glance)["ticks"] == "50; 5 a second"


def test_the_depth_stands_beside_the_height_the_highest_first(clock: Clock) -> None:
    so_far, glance = WavesSoFar(), Glance(clock=clock)
    for wave, (longest, depth) in enumerate([(2, 1), (5, 4), (2, 2), (5, 3)], 1):
        so_far.add(wire.Reached(1, wave, (0,), b"", depth, longest, 9, 0))
    glance.waves(so_far)
    assert rows(glance)["depth"] == "3 hops; deepest by height: 4 at 5, 2 at 2"
    assert rows(glance)["height"] == "9, the longest chain of implications now"


def test_how_far_it_is_behind_stands_there_while_it_is(clock: Clock) -> None:
    glance = Glance(clock=clock)
    glance.waves(waves(1, behind=Behind(1, 3.0, 0, "world", 0.5)))
    assert rows(glance)["behind"] == "3.0 s behind; the world took 50% of the time"
    glance.waves(waves(2))
    assert "behind" not in rows(glance)


def test_cells_that_are_not_there_are_named(clock: Clock) -> None:
    glance = Glance(parts=hosts(5, 0), clock=clock)
    for who in ("world", "cell/0", "cell/3", "cell/3/ab12", "cell/4"):
        glance.presence(who, alive=True)
    glance.presence("cell/4", alive=False)
    text = "2 of 5 alive; not there: cell/1, cell/2, cell/4"
    assert rows(glance)["cells"] == text


def test_the_last_findings_stand_once_each_the_newest_first(clock: Clock) -> None:
    glance = Glance(clock=clock)
    for line in ("one", "two", "three", "two", "four"):
        glance.found(line)
    assert [text for _, text in glance.rows()][1:] == ["four", "three", "two"]


def test_what_came_in_is_what_is_in_ticks_and_waits_and_was_lost(
    clock: Clock, tmp_path: Path
) -> None:
    log = tmp_path / "a.mcap"
    journal = Journal(journal_of(log), ["a"])
    for shown in (2, 5):
        journal.write(
            JournalRow(0, b"\x01", b"", received=wire.Received(shown, late=1))
        )
    outage = wire.Outage(1, 2, "gone")
    received = wire.Received(6, late=1, refused=2, outages=1)
    journal.take(Taken(received, outages=(outage,)))
    journal.close()
    glance = Glance(log=log, clock=clock)
    glance.waves(waves(1))
    assert rows(glance)["readings"] == (
        "9 received = 2 in ticks + 4 waiting + 1 late + 2 refused;"
        " could not listen 1 times"
    )
