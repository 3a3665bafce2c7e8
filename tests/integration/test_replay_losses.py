"""What derives a run again makes of messages that were lost."""

import itertools
from pathlib import Path
from typing import Any

import msgspec
import pytest

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.run_options import RunOptions, WiringKind
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.replay.verify import Verdict, verify
from tests.support.lossy_runs import LOST, Simulation, lost_once
from tests.support.recorded_messages import course, first, of_type
from tests.support.replayed_runs import TICKS, Runs, options_for
from tests.support.rewritten_recordings import changing, rewritten

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


def dropped_from(log: Path, target: Path, kind: type[wire.Message]) -> Verdict:
    """Verify a recording without the first message of one kind after tick 11."""

    def change(recorded: list[Recorded]) -> list[Recorded]:
        start, _ = first(recorded, wire.State, lambda s: s.tick == 11)
        later = itertools.islice(recorded, start, None)
        gone = next(r for r in later if isinstance(r.message, kind))
        return [each for each in recorded if each is not gone]

    return verify(rewritten(log, target, change))


@pytest.mark.parametrize("kind", [wire.State, wire.Reached, wire.WaveStart])
def test_a_lost_word_of_the_coordinator_makes_a_difference(
    runs: Runs, tmp_path: Path, kind: type[wire.Message]
) -> None:
    verdict = dropped_from(runs.of("path").log, tmp_path / "log", kind)
    assert not verdict.complete
    assert not verdict.same
    assert verdict.difference is not None
    assert verdict.difference.startswith("tick 1")


@pytest.mark.parametrize(
    ("kind", "ticks"),
    [(wire.Observation, 11), (wire.CellReport, 11), (wire.Pulse, TICKS)],
)
def test_what_cannot_be_derived_for_a_loss_is_incomplete_and_not_different(
    runs: Runs, tmp_path: Path, kind: type[wire.Message], ticks: int
) -> None:
    verdict = dropped_from(runs.of("path").log, tmp_path / "log", kind)
    assert verdict.difference is None
    assert not verdict.complete
    (first, last), *behind = verdict.ranges
    assert (first, last) in ((1, ticks), (1, ticks - 1))
    # From the next key-frame on there is all it takes.
    assert [stop for _, stop in behind] == ([TICKS] if ticks < TICKS else [])


@pytest.mark.parametrize("wiring", ["hasse", "derived"])
@pytest.mark.parametrize("what", LOST)
@pytest.mark.parametrize("seed", range(3))
def test_a_run_with_a_repeated_wave_comes_out_the_same(
    runs: Runs, tmp_path: Path, what: str, wiring: WiringKind, seed: int
) -> None:
    log = tmp_path / "log"
    options = options_for(runs.csv, wiring)
    Simulation(options, log, seed, lost_once(LOST[what])).run()
    repeated = [start for start in of_type(log, wire.WaveStart) if start.repeats]
    assert repeated
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == TICKS
    # And it is the run that would have been without the loss.
    assert course(log) == course(runs.of("csv", wiring).log)


def forgetting(
    monkeypatch: pytest.MonkeyPatch, options: RunOptions, times: int
) -> RunOptions:
    """Let the next cell that is told of edges more forget them, so many times.

    It says all the same that it is wired.
    """
    forgotten: list[tuple[int, tuple[int, ...]]] = []
    rewire = Cell._rewire

    def forgetful(cell: Cell, wiring: wire.Wiring, *rest: Any) -> None:
        if not forgotten and wiring.after > 1 and wiring.add:
            forgotten.extend([(cell.cell, wiring.add)] * times)
        if forgotten and cell.cell == forgotten[-1][0]:
            _, edges = forgotten.pop()
            kept = tuple(a for a in wiring.add if a not in edges)
            wiring = msgspec.structs.replace(wiring, add=kept)
        rewire(cell, wiring, *rest)

    monkeypatch.setattr(Cell, "_rewire", forgetful)
    # A key-frame would have it told again.
    return msgspec.structs.replace(options, keyframe_every=1000)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_that_has_forgotten_an_edge_is_told_of_it_again(
    runs: Runs, tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another cell waits for its pulse: so the wave is repeated."""
    log = tmp_path / "log"
    options = forgetting(monkeypatch, options_for(runs.csv), 1)
    Simulation(options, log, seed).run()
    assert [start for start in of_type(log, wire.WaveStart) if start.repeats]
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert course(log) == course(runs.of("csv").log)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_that_has_the_wrong_edges_is_found(
    runs: Runs, tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is told of them again and again, and never takes them in."""
    log = tmp_path / "log"
    options = forgetting(monkeypatch, options_for(runs.csv), 1000)
    Simulation(options, log, seed).run()
    verdict = verify(log)
    assert verdict.complete
    assert verdict.difference is not None
    assert ": cells reported [" in verdict.difference


def test_a_repeat_that_names_another_wave_is_found(runs: Runs, tmp_path: Path) -> None:
    log = tmp_path / "log"
    Simulation(options_for(runs.csv), log, 0, lost_once(LOST["pulse"])).run()
    tamper = changing(
        wire.WaveStart, lambda w: w.repeats > 0, lambda w: {"repeats": w.repeats - 1}
    )
    verdict = verify(rewritten(log, tmp_path / "tampered", tamper))
    assert verdict.difference is not None
    assert "/w" in verdict.difference  # its wave, or the wirings before it
