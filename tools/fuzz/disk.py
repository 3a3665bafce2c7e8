"""Damages recordings as disks do, and checks that nothing wrong is read from them.

A recorded run is cut, or gets one flipped bit, a block of zeros, or a tail of zeros; as
a finished file, one that still grows, and one of several files. Nothing crashes, every
message, state, order and decision that is given out is that of the undamaged run, a
replay finds no difference, and nothing damaged is called whole.
"""

import random
import shutil
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import msgspec

from neurosnap import wire
from neurosnap.apps.cli import recording_info
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import NeurosnapError, RecordingError
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.copying import salvage
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from tools.fuzz.altered_bytes import DISK_WAYS, damage
from tools.fuzz.run import Honest
from tools.fuzz.targets import Count, FuzzError, Target

_CHUNK = 3000
_SPLIT = 10_000  # bytes; smaller than one can ask for

_STATES = ("finished", "growing", "split")
"""What is damaged."""


class _Truth(NamedTuple):
    """The undamaged run."""

    payloads: dict[tuple[str, int], bytes]
    """Of each message, by sender and number."""
    snapshots: dict[int, bytes]
    """The order that was learned, by tick."""
    ticks: int
    files: dict[str, dict[str, bytes]]
    """For each state, the files by name."""


def _true_run(honest: Honest, folder: Path) -> _Truth:
    """Write an honest run again in each of `_STATES`."""
    recording = Recording.open(honest.log)
    return _Truth(
        payloads={
            (m.message.sender, m.sequence): m.payload for m in recording.messages()
        },
        snapshots={
            tick: _order(snapshot_at(recording, tick)[1])
            for tick in range(5, honest.options.ticks + 1, 17)
        },
        ticks=honest.options.ticks,
        files={state: _written(folder / state, recording, state) for state in _STATES},
    )


def _order(snapshot: Snapshot) -> bytes:
    return snapshot.poc_graph().wire_list("hasse").tobytes()


def _written(folder: Path, recording: Recording, state: str) -> dict[str, bytes]:
    """Return the files of a run that is written again, in chunks of some size."""
    folder.mkdir()
    log, expected = folder / "run.mcap", recording.noted().expected
    facts = recording.metadata

    def new_writer(path: Path) -> Writer:
        return Writer(path, chunk=_CHUNK)

    split = Split(_SPLIT) if state == "split" else None
    with SplitWriter(log, facts, split=split, new_writer=new_writer) as writer:
        for number, each in enumerate(recording.messages()):
            writer.add(each.delivery, each.log_time)
            if number % 100 == 0:
                writer.flush(each.log_time)
        if state == "growing":
            writer.flush(1 << 63)
        else:
            writer.finish(recording.totals or {}, expected)
    return {path.name: path.read_bytes() for path in part_paths(log).values()}


def disk_target(honest: Honest, folder: Path) -> Target:
    """Return the rounds of all that reads a recording; damaged copies go to a folder.

    Each damages one file in each state and way.
    """
    truth, damaged = _true_run(honest, folder), folder / "damaged"

    def each_way(chance: random.Random, count: Count) -> None:
        for state, way in product(_STATES, DISK_WAYS):
            files = dict(truth.files[state])
            name = chance.choice(sorted(files))
            files[name] = damage(files[name], b"", chance, (way,))
            shutil.rmtree(damaged, ignore_errors=True)
            damaged.mkdir()
            for each, content in files.items():
                (damaged / each).write_bytes(content)
            judge = partial(_judge, truth, damaged / "run.mcap")
            count.rejected += not count.timed(f"{state}, way {way}", judge)

    return each_way


def _judge(truth: _Truth, log: Path) -> bool:
    """Read a damaged recording in every way there is; tell whether a tick was derived.

    Raises:
        FuzzError: Something is given out that is not so.
    """
    try:
        recording = Recording.open(log)
        messages = _read(truth, recording)
    except RecordingError:
        return False
    derived = _derived(truth, log)
    _described(recording)
    _learned(truth, recording)
    _viewed(truth, log)
    _salvaged(truth, log, messages, derived)
    _resumed(truth, log)
    return derived > 0


def _read(truth: _Truth, recording: Recording) -> int:
    """Return how many messages are there, each of them the true one."""
    seen: set[tuple[str, int]] = set()
    for each in recording.messages():
        _demand(_is_true(truth, each), f"message {each.message}")
        seen.add((each.message.sender, each.sequence))
    if len(seen) < len(truth.payloads):
        _demand(not recording.whole, f"whole, with {len(seen)} messages")
    return len(seen)


def _is_true(truth: _Truth, each: Recorded) -> bool:
    return truth.payloads.get((each.message.sender, each.sequence)) == each.payload


def _derived(truth: _Truth, log: Path) -> int:
    try:
        verdict = verify(log)
    except RecordingError:
        return 0
    _demand(verdict.same, f"difference {verdict.difference}")
    if verdict.ticks < truth.ticks:
        _demand(not verdict.complete, f"complete, with {verdict.ticks} ticks")
    return verdict.ticks


def _described(recording: Recording) -> None:
    found = recording_info.describe(recording)
    list(recording_info.render(found))
    if recording.whole:
        _demand(found.completeness.whole, "whole, but for the info")


def _learned(truth: _Truth, recording: Recording) -> None:
    for tick in (None, *truth.snapshots):
        try:
            now, snapshot = snapshot_at(recording, tick)
        except NeurosnapError:
            _demand(not recording.whole, f"whole, and no order of tick {tick}")
            continue
        true = truth.snapshots.get(now)
        _demand(true in (None, _order(snapshot)), f"order of tick {now}")


def _viewed(truth: _Truth, log: Path) -> None:
    try:
        film = RunView(log)
    except RecordingError:
        return
    frames = film.frames(1, truth.ticks)
    for tick in truth.snapshots:
        try:
            snapshot = film.learned(tick).snapshot
        except NeurosnapError:
            continue
        _demand(_order(snapshot) == truth.snapshots[tick], f"view of tick {tick}")
    if len(frames) < truth.ticks:
        _demand(
            film.cut(live=False) is not None, f"view of {len(frames)} ticks, and no cut"
        )


def _resumed(truth: _Truth, log: Path) -> None:
    try:
        _, past = find_resume_point(log)
    except RecordingError:
        return
    state = next(
        message.literals
        for payload in truth.payloads.values()
        if isinstance(message := _message(payload), wire.State)
        and message.tick == past.tick
    )
    _demand(past.state == state, f"state to go on from at tick {past.tick}")


def _message(payload: bytes) -> wire.Message:
    message: wire.Message = msgspec.json.Decoder(wire.Message).decode(payload)
    return message


def _salvaged(truth: _Truth, log: Path, messages: int, derived: int) -> None:
    """Salvage it, and read that."""
    out = log.with_name("salvaged.mcap")
    try:
        salvage(log, out)
    except RecordingError:
        _demand(not out.exists(), "a file left by what failed")
        return
    again = Recording.open(out)
    _demand(_read(truth, again) == messages, "other messages salvaged than there are")
    _demand(again.files[0].layout.sealed, "damage in what was salvaged")
    _demand(_derived(truth, out) == derived, f"other ticks salvaged than {derived}")
    out.unlink()


def _demand(held: bool, what: str) -> None:
    if not held:
        raise FuzzError(what)
