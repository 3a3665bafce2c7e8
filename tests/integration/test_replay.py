"""Replay reproduces a recorded run; resume continues it from its end or from a cut.

Of key-frames in bands, too: with one learner the coordinator sends these; with shares
each worker sends its own.
"""

import itertools
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.depth.measure import from_recording
from neurosnap.errors import RecordingError
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.run_options import RunOptions, SnapshotKind, WiringKind
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.read.replay_starts import starts
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.recording.replay.verify import Verdict, verify
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.sensorium import unpack
from tests.golden.drive import drive, record
from tests.support.course import course
from tests.support.inline_runs import recorded_run, spread
from tests.support.recorded_messages import assert_true_run, first, of_type
from tests.support.replayed_runs import TICKS, Runs, every_run, options_for, readings
from tests.support.rewritten_recordings import (
    Change,
    changing,
    dropping,
    flipped,
    rewritten,
    saying,
    write_again,
)
from tests.support.scripted_sources import Scripted

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


# Verifying ----------------------------------------------------------------------------


@every_run
def test_a_run_comes_out_the_same_from_its_start_and_from_any_key_frame(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, _, outcome = runs.of(name, wiring, snapshot)
    verdict = assert_true_run(log)
    counts = (verdict.ticks, verdict.states, verdict.decisions)
    assert counts == (TICKS, TICKS, TICKS)
    assert verdict.waves == len(of_type(log, wire.WaveStart)) > TICKS
    assert verdict.wirings == len(of_type(log, wire.Wiring)) > 0
    assert outcome.totals.ticks == TICKS
    for tick, start in ((7, 7), (13, 7), (14, 14), (27, 21), (28, 28), (99, TICKS)):
        verdict = assert_true_run(log, tick)
        assert (verdict.start, verdict.ticks) == (start, TICKS - start)
    # Before the first there is nothing to begin with but the run.
    assert (verify(log, 6).start, verify(log, 6).ticks) == (0, TICKS)


# Runs that did not go smoothly --------------------------------------------------------


Lost: TypeAlias = Callable[[wire.Message], bool]


def lossy_run(
    options: RunOptions,
    log: Path,
    seed: int,
    lost: Lost | None = None,
) -> None:
    """Record a run.

    Args:
        options: What to run; it reads `readings`.
        log: Where to record. What is lost is recorded.
        seed: Draws the order of the messages.
        lost: The first message to a cell of which this is true is lost, and a wave that
            is stuck for it is declared late; None if none is.
    """
    left = lost

    def loses(who: str, message: wire.Message) -> bool:
        nonlocal left
        if left is None or not who.startswith("cell/") or not left(message):
            return False
        left = None
        return True

    driven = drive(options, Scripted(readings()), seed, lost=loses)
    record(driven, options, log)


LOST: dict[str, Lost] = {
    "pulse": lambda m: isinstance(m, wire.Pulse) and m.wave > 20,
    "start": lambda m: isinstance(m, wire.WaveStart) and m.wave > 20,
}


# What was changed ---------------------------------------------------------------------


def wave_of(recorded: Iterable[Recorded], tick: int) -> int:
    states = (each.message for each in recorded)
    return next(s.wave for s in states if isinstance(s, wire.State) and s.tick == tick)


def change_report(recorded: list[Recorded]) -> list[Recorded]:
    """Let a cell report its complement in tick 12's state wave."""
    wave = wave_of(recorded, 12)
    place, report = first(
        recorded, wire.CellReport, lambda s: s.wave == wave and len(s.literals) == 1
    )
    recorded[place] = saying(recorded[place], literals=(report.literals[0] ^ 1,))
    return recorded


def swap_states(recorded: list[Recorded]) -> list[Recorded]:
    """Swap the states of ticks 12 and 13 in the file."""
    (a, _), (b, _) = (
        first(recorded, wire.State, lambda s, tick=tick: s.tick == tick)  # type: ignore[misc]
        for tick in (12, 13)
    )
    recorded[a], recorded[b] = recorded[b], recorded[a]
    return recorded


def change_wiring(recorded: list[Recorded]) -> list[Recorded]:
    """Let one of a wiring's targets be another."""
    place, wiring = first(recorded, wire.Wiring, lambda w: len(w.add) > 0)
    recorded[place] = saying(recorded[place], add=(wiring.add[0] ^ 1, *wiring.add[1:]))
    return recorded


def close_up(recorded: list[Recorded]) -> list[Recorded]:
    """Take a report of tick 12 out so that no number shows it."""
    wave = wave_of(recorded, 12)
    place, report = first(recorded, wire.CellReport, lambda s: s.wave == wave)
    gone = recorded.pop(place)
    return [
        each._replace(sequence=each.sequence - 1)
        if each.message.sender == report.sender and each.sequence > gone.sequence
        else each
        for each in recorded
    ]


def at_12(kind: type[Any], to: Callable[[Any], dict[str, object]]) -> Change:
    """Return the change of the first message of a kind that is of tick 12."""
    return changing(kind, lambda message: message.tick == 12, to)


TAMPERED: dict[str, tuple[Change, str]] = {
    "observation": (
        at_12(wire.Observation, lambda o: {"bits": flipped(o.bits, 1)}),
        r"tick 12: /(wiring|wavestart|state) ",
    ),
    "observation's length": (
        at_12(wire.Observation, lambda o: {"bits": o.bits + b"1"}),
        r"tick 12: /observation: ",
    ),
    "state": (
        at_12(wire.State, lambda s: {"literals": flipped(s.literals)}),
        r"tick 12: /state coordinator \d+: recorded .*, derived ",
    ),
    "state's depth": (
        at_12(wire.State, lambda s: {"depth": s.depth + 1}),
        r"tick 12: /state ",
    ),
    "reached": (
        at_12(wire.Reached, lambda r: {"literals": flipped(r.literals)}),
        r"tick 12: /reached ",
    ),
    "question": (
        changing(
            wire.WaveStart,
            lambda w: w.tick == 12 and w.kind == "signal",
            lambda w: {"signal": (w.signal[0] ^ 1,)},
        ),
        r"tick 12: /wavestart ",
    ),
    "action": (
        at_12(wire.Decision, lambda d: {"action": d.action + 1}),
        r"tick 12: /decision ",
    ),
    "reason": (at_12(wire.Decision, lambda _: {"why": "so"}), r"tick 12: /decision "),
    "keyframe": (
        changing(
            wire.KeyFrame,
            lambda k: k.tick == 14,
            lambda k: {"snapshot": flipped(k.snapshot, 8 * len(k.snapshot) - 1)},
        ),
        r"tick 14: /keyframe ",
    ),
    "wiring": (change_wiring, r"tick \d+: /wiring "),
    "report": (change_report, r"tick 12: /state "),
    "report's pulses": (
        changing(wire.CellReport, lambda _: True, lambda s: {"pulses": s.pulses + 1}),
        r"tick 1: /state ",
    ),
    "order of two states": (swap_states, r"tick 1[23]: /state "),
}


@pytest.mark.parametrize("change", TAMPERED)
@pytest.mark.parametrize(("name", "wiring"), [("path", "hasse"), ("csv", "derived")])
def test_a_changed_message_is_found_and_named(
    runs: Runs, tmp_path: Path, name: str, wiring: WiringKind, change: str
) -> None:
    """Not where a replay begins behind it."""
    tamper, where = TAMPERED[change]
    log = rewritten(runs.of(name, wiring).log, tmp_path / "log", tamper)
    verdict = verify(log)
    assert verdict.complete  # every message is there; one of them lies
    assert re.match(where, str(verdict.difference)), verdict.difference
    if name == "csv":
        return
    differences = {tick: verify(log, tick).difference for tick in (7, 14, 21)}
    if change == "keyframe":  # that of tick 14: its last bit says nothing
        assert differences[7] is not None
    elif change in ("report's pulses", "wiring"):  # of tick 1, and of the first
        assert differences[21] is None
    else:
        assert re.match(where, str(differences[7])), differences[7]
        assert differences[14] is differences[21] is None


def test_a_report_taken_out_with_its_number_is_found(
    runs: Runs, tmp_path: Path
) -> None:
    recording = Recording.open(runs.of("path").log)
    recorded = close_up(list(recording.messages()))
    expected: dict[str, int] = {}
    for each in recorded:
        expected[each.message.sender] = each.sequence + 1
    verdict = verify(
        write_again(recording, tmp_path / "log", recorded, expected=expected)
    )
    assert verdict.complete
    assert str(verdict.difference).startswith("tick 12: /state ")
    assert str(verdict.difference).endswith("derived nothing")


def test_a_key_frame_that_lies_is_found_by_what_follows(
    runs: Runs, tmp_path: Path
) -> None:
    for number, changes in enumerate(
        (
            lambda k: {"waves": k.waves + 1},
            lambda k: {"epochs": (k.epochs[0] + 1,)},
            lambda k: {"action": 1 - k.action},
            lambda k: {"why": "so"},
        )
    ):
        tamper = changing(wire.KeyFrame, lambda k: k.tick == 14, changes)
        log = rewritten(runs.of("path").log, tmp_path / f"{number}", tamper)
        for tick in (7, 14):  # as it is derived, and as it is believed
            said = str(verify(log, tick).difference)
            assert said.startswith(("tick 14: ", "tick 15: "))
        assert verify(log, 21).same


# What was lost ------------------------------------------------------------------------


def dropped_from(log: Path, target: Path, kind: type[wire.Message]) -> Verdict:
    """Verify a recording without the first message of one kind after tick 11."""

    def change(recorded: list[Recorded]) -> list[Recorded]:
        start, _ = first(recorded, wire.State, lambda s: s.tick == 11)
        later = itertools.islice(recorded, start, None)
        gone = next(r for r in later if isinstance(r.message, kind))
        return [each for each in recorded if each is not gone]

    return verify(rewritten(log, target, change))


@pytest.mark.parametrize(
    ("kind", "ticks"),
    [
        # Words of the coordinator make a difference.
        *((kind, None) for kind in (wire.State, wire.Reached, wire.WaveStart)),
        # What cannot be derived for a loss does not.
        *((kind, 11) for kind in (wire.Observation, wire.CellReport)),
        (wire.Pulse, TICKS),
    ],
)
def test_what_is_lost_is_incomplete_and_different_only_if_the_coordinator_said_it(
    runs: Runs, tmp_path: Path, kind: type[wire.Message], ticks: int | None
) -> None:
    verdict = dropped_from(runs.of("path").log, tmp_path / "log", kind)
    assert not verdict.complete
    assert verdict.same == (ticks is not None)
    if ticks is None:
        assert str(verdict.difference).startswith("tick 1")
        return
    (first, last), *behind = verdict.ranges
    assert (first, last) in ((1, ticks), (1, ticks - 1))
    # From the next key-frame on there is all it takes.
    assert [stop for _, stop in behind] == ([TICKS] if ticks < TICKS else [])


def test_a_cell_that_never_has_an_edge_it_was_told_of_is_found(
    runs: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It says all the same that it is wired; another cell waits for its pulse."""
    forgotten: list[tuple[int, tuple[int, ...]]] = []
    rewire = Cell._rewire

    def forgetful(cell: Cell, wiring: wire.Wiring, *rest: Any) -> None:
        if not forgotten and wiring.after > 1 and wiring.add:
            forgotten.append((cell.cell, wiring.add))
        if forgotten and cell.cell == forgotten[0][0]:
            kept = tuple(a for a in wiring.add if a not in forgotten[0][1])
            wiring = msgspec.structs.replace(wiring, add=kept)
        rewire(cell, wiring, *rest)

    monkeypatch.setattr(Cell, "_rewire", forgetful)
    # A key-frame would have it told again.
    options = msgspec.structs.replace(options_for(runs.csv), keyframe_every=1000)
    log = tmp_path / "log"
    lossy_run(options, log, 0)
    assert [start for start in of_type(log, wire.WaveStart) if start.repeats]
    verdict = verify(log)
    assert verdict.complete
    assert ": cells reported [" in str(verdict.difference)


def test_a_repeat_that_names_another_wave_is_found(runs: Runs, tmp_path: Path) -> None:
    log = tmp_path / "log"
    lossy_run(options_for(runs.csv), log, 0, LOST["pulse"])
    tamper = changing(
        wire.WaveStart, lambda w: w.repeats > 0, lambda w: {"repeats": w.repeats - 1}
    )
    verdict = verify(rewritten(log, tmp_path / "tampered", tamper))
    assert "/w" in str(verdict.difference)  # its wave, or the wirings before it


# What was cut -------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["pulse", "start"])
def test_a_cut_recording_of_a_repeated_wave_is_never_different(
    runs: Runs, tmp_path: Path, what: str
) -> None:
    log = tmp_path / "log"
    lossy_run(options_for(runs.csv), log, 1, LOST[what])
    recording = Recording.open(log)
    recorded = list(recording.messages())
    repeat, _ = first(recorded, wire.WaveStart, lambda w: w.repeats > 0)
    for end in range(repeat - 12, repeat + 12):
        cut = tmp_path / f"{end}.mcap"
        with Writer(cut) as writer:  # left without an end
            writer.start(recording.metadata)
            for each in recorded[:end]:
                writer.add(each.delivery, each.log_time)
        verdict = verify(cut)
        assert verdict.difference is None, f"cut after {end}: {verdict.difference}"
        assert not verdict.complete


# What it goes on from -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (dropping(wire.State, and_after=True), "must hold a whole tick .*, got none"),
        (
            # What counts is what follows the last key-frame but one, that of tick 28.
            changing(
                wire.State,
                lambda s: s.tick == 29,
                lambda s: {"literals": flipped(s.literals)},
            ),
            "must be a true run: tick 29: /state",
        ),
        (
            dropping(wire.Pulse),
            rf"must be whole up to tick {TICKS}, lacks \{{'cell/\d': 1\}}",
        ),
    ],
    ids=["no whole tick", "tampered", "lacks a pulse"],
)
def test_what_cannot_be_proved_is_not_gone_on_with(
    runs: Runs, tmp_path: Path, change: Change, rule: str
) -> None:
    log = rewritten(runs.of("csv").log, tmp_path / "log", change)
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(log)


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with Writer(log) as writer:
        writer.start({"world": "none"})
        writer.finish({}, {})
    rule = r"log: options: must be those of a run, got nothing$"
    with pytest.raises(RecordingError, match=rule):
        verify(log)
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(log)


# What had been learned, and how deep waves went ---------------------------------------


def learned(snapshot: Snapshot) -> dict[str, object]:
    """Return all of a snapshot but its state, comparable."""
    arrays = {n: a.tolist() for n, a in snapshot.arrays().items() if n != "state"}
    return {"kind": type(snapshot).__name__, **arrays}


@pytest.mark.parametrize(
    ("name", "snapshot"), [("path", "discounted"), ("csv", "empirical")]
)
def test_a_snapshot_at_a_tick_is_one_that_learned_that_far(
    runs: Runs, name: str, snapshot: SnapshotKind
) -> None:
    log, options, _ = runs.of(name, "hasse", snapshot)
    recording = Recording.open(log)
    assert TickIndex(recording).last_tick() == TICKS
    frames = [frame.tick for frame in of_type(log, wire.KeyFrame)]
    assert frames == [7, 14, 21, 28, TICKS]
    reference = options.new_snapshot()
    assert learned(snapshot_at(recording, 0)[1]) == learned(reference)
    for observation in of_type(log, wire.Observation):
        reference.learn(unpack(observation.bits, len(options.sensors)))
        tick, found = snapshot_at(recording, observation.tick)
        assert tick == observation.tick == found.clock
        assert learned(found) == learned(reference)
        assert np.array_equal(found.poc_graph().edges, reference.poc_graph().edges)
    assert learned(snapshot_at(recording)[1]) == learned(reference)


# Depth --------------------------------------------------------------------------------


@every_run
def test_a_recording_gives_a_row_for_every_wave(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, options, outcome = runs.of(name, wiring, snapshot)
    rows = from_recording(Recording.open(log))
    results: list[wire.State | wire.Reached] = [
        *of_type(log, wire.State),
        *of_type(log, wire.Reached),
    ]
    results.sort(key=lambda result: result.wave)
    assert [(r.depth, r.height, r.longest, r.pulses) for r in rows] == [
        (r.depth, r.height, r.longest, r.pulses) for r in results
    ]
    assert [row.kind for row in rows] == [
        "state" if isinstance(result, wire.State) else "signal" for result in results
    ]
    assert {(row.sensors, row.wiring) for row in rows} == {
        (len(options.sensors), wiring)
    }
    assert all(row.seconds > 0 for row in rows)
    assert sum(row.seconds for row in rows) < outcome.seconds
    assert max(row.depth for row in rows) == outcome.totals.depth > 0
    # To a representative, along an edge, to a member: however high the order is.
    most = 3 if wiring == "derived" else TICKS
    assert all(row.depth <= min(most, row.height + 2) for row in rows)


def test_a_wave_whose_start_was_lost_is_named(runs: Runs, tmp_path: Path) -> None:
    lost = dropping(wire.WaveStart, lambda start: start.wave == 7)
    recording = Recording.open(rewritten(runs.of("csv").log, tmp_path / "log", lost))
    with pytest.raises(RecordingError, match=r"wave 7: must have its start, got none$"):
        from_recording(recording)


FRAMES = [7, 14, 21, 28, 30]


class Banded(NamedTuple):
    """A recorded run whose key-frames are in bands, and the same run without."""

    kind: str
    runs: Runs
    log: Path


def record_bands(runs: Runs, kind: str, log: Path, **changes: Any) -> Path:
    given = {"band": 4, "workers": 1, **changes}
    options = msgspec.structs.replace(options_for(runs.csv), **given)
    recorded_run(spread(options) if kind == "shares" else options, log)
    return log


@pytest.fixture(scope="module", params=["one learner", "shares"])
def banded(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Banded:
    folder = tmp_path_factory.mktemp("banded")
    runs = Runs(folder)
    log = record_bands(runs, request.param, folder / "log")
    return Banded(request.param, runs, log)


def known_in(snapshot: Snapshot) -> bytes:
    """Return what was learned, of each sensor, without the state."""
    snapshot.adopt(np.zeros(10, np.bool_))
    return snapshot.to_bytes()


def test_each_key_frame_is_followed_by_its_bands(banded: Banded) -> None:
    log = banded.log
    frames = of_type(log, wire.KeyFrame)
    assert [frame.tick for frame in frames] == FRAMES
    # Ten pairs, four of them in a band, of counts and of dates; six as long as two
    # sensors are twins. Of shares one worker has those of four sensors, and
    # the head is in a band, too.
    several = np.array([4, 4, 6, 6, 6]) + (banded.kind == "shares")
    counts = several.tolist()
    assert [frame.bands for frame in frames] == counts
    bands = of_type(log, wire.Band)
    ticks = np.repeat(FRAMES, counts).tolist()
    assert sorted(band.tick for band in bands) == ticks
    assert {(band.who, band.offset) for band in bands} == (
        {("coordinator", 0), ("worker/0", 0), ("worker/0", 4), ("worker/1", 6)}
        if banded.kind == "shares"
        else {("coordinator", offset) for offset in (0, 4, 8)}
    )
    assert_true_run(log, ticks=TICKS)
    assert course(log) == course(banded.runs.of("csv").log)


def test_what_was_learned_is_read_from_them(banded: Banded) -> None:
    log, whole = banded.log, Recording.open(banded.runs.of("csv").log)
    for tick in (7, 10, 28, 30):
        _, learned = snapshot_at(Recording.open(log), tick)
        _, without = snapshot_at(whole, tick)
        assert known_in(learned) == known_in(without)
        assert known_in(RunView(log).learned(tick).snapshot) == known_in(without)
    assert [start.frame.tick for start in starts(Recording.open(log))][-1] == 30


def test_they_go_into_the_file_that_their_key_frame_begins(
    banded: Banded, tmp_path: Path
) -> None:
    old, split = Recording.open(banded.log), tmp_path / "split.mcap"
    with SplitWriter(split, old.metadata, split=Split(3000)) as writer:
        for recorded in old.messages():
            writer.add(recorded.delivery, recorded.log_time)
            writer.flush(recorded.log_time)
        writer.finish({}, old.noted().expected)
    files = part_paths(split)
    assert len(files) > 2
    for number, path in files.items():
        recording = Recording.open(path)
        if number:
            assert next(starts(recording)).frame.tick == recording.begins
        assert_true_run(path)
    assert verify(split).ticks == TICKS
    _, past = find_resume_point(split)
    assert (past.tick, past.part) == (TICKS, len(files) - 1)
    # If the last file's key-frame is not whole, the run goes on from the one before.
    last = Recording.open(files[len(files) - 1])
    kept = [r for r in last.messages() if not isinstance(r.message, wire.Band)]
    frame = next(i for i, r in enumerate(kept) if isinstance(r.message, wire.KeyFrame))
    cut = tmp_path / "cut.mcap"
    with Writer(cut) as writer:
        writer.start(last.metadata)
        for sender, number in (last.files[0].share or {}).items():
            writer.sequences.begin(sender, number)
        writer.write_share()
        for recorded in kept[: frame + 1]:
            writer.add(recorded.delivery, recorded.log_time)
        writer.abandon()
    cut.replace(files[len(files) - 1])
    _, past = find_resume_point(split)
    assert (past.tick, past.part) == (last.begins, len(files) - 2)


def test_a_lost_band_makes_its_recording_incomplete_and_not_different(
    banded: Banded, tmp_path: Path
) -> None:
    lost = dropping(wire.Band, lambda band: band.tick == 14)
    lossy = rewritten(banded.log, tmp_path / "lossy", lost)
    assert [one.frame.tick for one in starts(Recording.open(lossy))] == [7, 21, 28, 30]
    verdict = verify(lossy)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, False, TICKS)
    assert verify(lossy, 15).start == 7
    _, learned = snapshot_at(Recording.open(lossy), 15)
    _, whole = snapshot_at(Recording.open(banded.log), 15)
    assert known_in(learned) == known_in(whole)


def test_lost_learning_ends_what_can_be_derived(banded: Banded, tmp_path: Path) -> None:
    if banded.kind != "shares":
        return  # one learner publishes nothing of it
    lost = dropping(wire.Learned, lambda learned: learned.tick == 9)
    verdict = verify(rewritten(banded.log, tmp_path / "lossy", lost))
    assert verdict.difference is None
    assert not verdict.complete
    assert (1, 8) in verdict.ranges


BAND = "/band "
_PAIR = {"latter": b"\1\0\0\0", "former": b"\0\0\0\0"}
WRONG: list[tuple[type[wire.Message], int, dict[str, Any], str]] = [
    (wire.Band, 14, {"data": memoryview(b"\7" * 16)}, BAND),
    (wire.Band, 14, {"array": "clock"}, BAND),
    (wire.Band, 14, {"offset": 5}, BAND),
    (wire.Learned, 12, {**_PAIR, "codes": b"\3"}, "/learned"),
    (wire.Learn, 14, {"bits": b"\0"}, "/learn"),
]


@pytest.mark.parametrize(("kind", "tick", "changes", "topic"), WRONG)
def test_what_does_not_follow_is_found(
    banded: Banded,
    tmp_path: Path,
    kind: type[wire.Message],
    tick: int,
    changes: dict[str, Any],
    topic: str,
) -> None:
    if banded.kind != "shares" and kind is not wire.Band:
        return  # one learner publishes nothing of it
    wrong = changing(kind, lambda m: getattr(m, "tick", 0) == tick, lambda _: changes)
    verdict = verify(rewritten(banded.log, tmp_path / "wrong", wrong))
    assert not verdict.same
    assert str(verdict.difference).startswith(f"tick {tick}: {topic}")
