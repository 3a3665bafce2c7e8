"""A recorded run derived again comes out the same, whole and from any key-frame."""

import itertools
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.protocol.run_options import SnapshotKind, WiringKind
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.verify import verify
from tests.support.inline_runs import recorded_run
from tests.support.lossy_runs import Simulation
from tests.support.recorded_messages import of_type
from tests.support.replayed_runs import TICKS, Runs, every_run, options_for, readings
from tests.support.rewritten_recordings import Change, rewritten
from tests.support.shuffled_recordings import by_sender, shuffled

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


# Verifying ----------------------------------------------------------------------------


@every_run
def test_a_run_comes_out_the_same(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, _, outcome = runs.of(name, wiring, snapshot)
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.same
    assert verdict.complete
    counts = (verdict.ticks, verdict.states, verdict.decisions)
    assert counts == (TICKS, TICKS, TICKS)
    assert verdict.waves == len(of_type(log, wire.WaveStart)) > TICKS
    assert verdict.wirings == len(of_type(log, wire.Wiring)) > 0
    assert outcome.totals.ticks == TICKS


@pytest.mark.parametrize(
    ("wiring", "snapshot"), [("hasse", "discounted"), ("derived", "empirical")]
)
def test_the_runs_hold_contradictions_and_equivalences(
    runs: Runs, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, _, outcome = runs.of("csv", wiring, snapshot)
    assert outcome.totals.incoherent > 0
    recording = Recording.open(log)
    graphs = [snapshot_at(recording, tick)[1].poc_graph() for tick in range(12, 19)]
    equivalent = any(len(members) > 1 for g in graphs for members in g.classes())
    # A discounted weight never is 0, which is what an equivalence takes.
    assert equivalent == (snapshot == "empirical")
    dropped = [w for w in of_type(log, wire.Wiring) if w.drop or w.drop_complement]
    assert dropped


def test_rewriting_alone_changes_nothing(runs: Runs, tmp_path: Path) -> None:
    verdict = verify(rewritten(runs.of("csv").log, tmp_path / "log", lambda r: r))
    assert verdict.same
    assert verdict.complete


# From a key-frame on ------------------------------------------------------------------


@every_run
def test_a_run_can_be_derived_from_any_key_frame(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, _, _ = runs.of(name, wiring, snapshot)
    for tick, start in ((7, 7), (13, 7), (14, 14), (27, 21), (28, 28), (99, TICKS)):
        verdict = verify(log, tick)
        assert (verdict.difference, verdict.complete) == (None, True)
        assert (verdict.start, verdict.ticks) == (start, TICKS - start)
    # Before the first there is nothing to begin with but the run.
    assert (verify(log, 6).start, verify(log, 6).ticks) == (0, TICKS)


# Senders that overtake each other -----------------------------------------------------


def one_after_the_other(last: str) -> Change:
    """Return the change that lets one sender's messages come after all others."""

    def change(recorded: list[Recorded]) -> Iterable[Recorded]:
        queues = by_sender(recorded)
        late = [queues.pop(who) for who in list(queues) if who.startswith(last)]
        return itertools.chain(*queues.values(), *late)

    return change


OVERTAKING = {
    "seed 0": shuffled(0),
    "seed 1": shuffled(1),
    "late reports": one_after_the_other("cell/"),
    "late observations": one_after_the_other("world"),
    "late coordinator": one_after_the_other("coordinator"),
}


@pytest.mark.parametrize("order", OVERTAKING)
@pytest.mark.parametrize("name", ["path", "csv"])
def test_senders_may_overtake_each_other(
    runs: Runs, tmp_path: Path, name: str, order: str
) -> None:
    log = rewritten(runs.of(name).log, tmp_path / "log", OVERTAKING[order])
    for tick in (0, 14):
        verdict = verify(log, tick)
        assert verdict.difference is None
        assert verdict.complete
        assert verdict.ticks == TICKS - tick


# Runs that did not go smoothly --------------------------------------------------------


def test_a_stopped_run_comes_out_the_same(runs: Runs, tmp_path: Path) -> None:
    log = tmp_path / "log"
    outcome = recorded_run(runs.of("path").options, log, stop_at=9)
    assert outcome.stopped
    assert 9 <= outcome.totals.ticks < TICKS
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == outcome.totals.ticks
    assert of_type(log, wire.KeyFrame)[-1].tick == outcome.totals.ticks


def test_a_run_ends_in_order_where_its_source_does(runs: Runs, tmp_path: Path) -> None:
    log = tmp_path / "log"
    outcome = recorded_run(options_for(runs.csv, ticks=1000), log)
    assert not outcome.stopped
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == outcome.totals.ticks == len(readings())


STOPS: dict[str, Callable[[Simulation], bool]] = {
    "between two ticks": lambda s: s.core.tick >= 9 and not s.core.in_flight,
    "in the middle of a tick": lambda s: s.core.tick >= 9 and bool(s.core.in_flight),
    "where a key-frame is due": lambda s: s.core.tick == 7,
    "before the first": lambda s: True,
}


@pytest.mark.parametrize("when", STOPS)
@pytest.mark.parametrize("seed", range(3))
def test_a_run_may_stop_anywhere(
    runs: Runs, tmp_path: Path, when: str, seed: int
) -> None:
    log = tmp_path / "log"
    simulation = Simulation(options_for(runs.csv), log, seed)
    simulation.run(STOPS[when])
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == simulation.core.tick < TICKS
