#!/usr/bin/env python3
"""Recordings damaged in every way a disk damages them; exit code 1 on a wrong datum.

    tools/damage.py [--files 3000] [--seed 1] [--first 0] [--only STATE/KIND/NUMBER]

A recorded run is cut, or gets one flipped bit, a block of zeros, or a tail of zeros; as
a finished file, one that still grows, and one of several files. Of each it must hold
that nothing crashes, that every message and every state, order and decision that is
given out is that of the undamaged run, that a replay finds no difference, and that
nothing damaged is called whole. What is printed is how much of the run is still there:
of its messages, and of its ticks, derived or learned again.
"""

import argparse
import asyncio
import random
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

# Run as a file, the folder of this file is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.cli import recording_info
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import NeurosnapError, RecordingError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_path, part_paths
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.copying import salvage
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from neurosnap.sources.open import open_source

TICKS = 60
_EVERY = 6  # ticks from key-frame to key-frame
_CHUNK = 3000
_BLOCK = 4096
_SPLIT = 10_000  # bytes; smaller than one can ask for

STATES = ("finished", "growing", "split")
"""What is damaged."""


class WrongError(Exception):
    """Something was given out that is not so."""


class Truth(NamedTuple):
    """The undamaged run."""

    payloads: dict[tuple[str, int], bytes]
    """Of each message, by sender and number."""
    snapshots: dict[int, bytes]
    """The order that was learned, by tick."""
    files: dict[str, dict[str, bytes]]
    """For each state, the files by name."""


def cut(whole: bytes, chance: random.Random) -> bytes:
    """Return a file that ends too soon."""
    return whole[: chance.randrange(len(whole))]


def flipped(whole: bytes, chance: random.Random) -> bytes:
    """Return a file with one bit flipped."""
    damaged = bytearray(whole)
    damaged[chance.randrange(len(whole))] ^= 1 << chance.randrange(8)
    return bytes(damaged)


def zeroed(whole: bytes, chance: random.Random) -> bytes:
    """Return a file with a block of zeros, where a disk has its blocks."""
    at = chance.randrange(0, len(whole), _BLOCK)
    gone = len(whole[at : at + _BLOCK])
    return whole[:at] + bytes(gone) + whole[at + gone :]


def zero_tail(whole: bytes, chance: random.Random) -> bytes:
    """Return a file that ends with zeros, as after a power cut."""
    at = chance.randrange(len(whole))
    return whole[:at] + bytes(len(whole) - at)


KINDS: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "cut": cut,
    "flipped bit": flipped,
    "zeroed block": zeroed,
    "zero tail": zero_tail,
}


def true_run(folder: Path) -> Truth:
    """Record a run, and write it again in each of `STATES`."""
    source = open_source("neurosnap/Path-v0", 5, {"places": 5})
    source.close()
    options = RunOptions(
        source="neurosnap/Path-v0",
        arguments={"places": 5},
        body=Body(own=source.sensors, actions=source.actions, orders=source.orders),
        ticks=TICKS,
        seed=5,
        threshold=0.08,
        keyframe_every=_EVERY,
        cells="inline",
        watch=True,
    )
    log = folder / "true.mcap"
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    recording = Recording.open(log)
    messages = list(recording.messages())
    files = {state: _written(folder / state, recording, state) for state in STATES}
    return Truth(
        payloads={(m.message.sender, m.sequence): m.payload for m in messages},
        snapshots={
            tick: _order(snapshot_at(recording, tick)[1])
            for tick in range(5, TICKS + 1, 17)
        },
        files=files,
    )


def _order(snapshot: Snapshot) -> bytes:
    return snapshot.poc_graph().wires("hasse").tobytes()


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
            writer.finish({"ticks": str(TICKS)}, expected)
    return {path.name: path.read_bytes() for path in part_paths(log).values()}


class Found(NamedTuple):
    """What is left of a damaged recording."""

    messages: int
    derived: int
    """Ticks that a replay verified."""
    learned: int
    """Ticks of which a view shows the order."""
    resumes: bool
    refused: str


def judge(truth: Truth, log: Path) -> Found:
    """Read a damaged recording in every way there is.

    Raises:
        WrongError: Something is given out that is not so.
    """
    try:
        recording = Recording.open(log)
        messages = _read(truth, recording)
    except RecordingError as error:
        return Found(0, 0, 0, False, str(error))
    derived = _derived(log)
    _told(recording)
    _learned(truth, recording)
    learned = _viewed(truth, log)
    _salvaged(truth, log, messages, derived)
    return Found(messages, derived, learned, _resumes(truth, log), "")


def _read(truth: Truth, recording: Recording) -> int:
    """Return how many messages are there, each of them the true one."""
    seen: set[tuple[str, int]] = set()
    for each in recording.messages():
        _demand(_is_true(truth, each), f"message {each.message}")
        seen.add((each.message.sender, each.sequence))
    if len(seen) < len(truth.payloads):
        _demand(not recording.whole, f"whole, with {len(seen)} messages")
    return len(seen)


def _is_true(truth: Truth, each: Recorded) -> bool:
    return truth.payloads.get((each.message.sender, each.sequence)) == each.payload


def _derived(log: Path) -> int:
    try:
        verdict = verify(log)
    except RecordingError:
        return 0
    _demand(verdict.same, f"difference {verdict.difference}")
    if verdict.ticks < TICKS:
        _demand(not verdict.complete, f"complete, with {verdict.ticks} ticks")
    return verdict.ticks


def _told(recording: Recording) -> None:
    found = recording_info.describe(recording)
    recording_info.render(found)
    if recording.whole:
        _demand(found.completeness.whole, "whole, but for the info")


def _learned(truth: Truth, recording: Recording) -> None:
    for tick in (None, *truth.snapshots):
        try:
            now, snapshot = snapshot_at(recording, tick)
        except NeurosnapError:
            _demand(not recording.whole, f"whole, and no order of tick {tick}")
            continue
        true = truth.snapshots.get(now)
        _demand(true in (None, _order(snapshot)), f"order of tick {now}")


def _viewed(truth: Truth, log: Path) -> int:
    """Return of how many ticks a view shows the learned order."""
    try:
        film = RunView(log)
    except RecordingError:
        return 0
    frames = film.frames(1, TICKS)
    for tick in truth.snapshots:
        try:
            snapshot = film.snapshot(tick)
        except NeurosnapError:
            continue
        _demand(_order(snapshot) == truth.snapshots[tick], f"view of tick {tick}")
    if len(frames) < TICKS:
        _demand(film.cut is not None, f"view of {len(frames)} ticks, and no cut")
    return sum(frame.graph != "" for frame in frames)


def _resumes(truth: Truth, log: Path) -> bool:
    try:
        _, past = find_resume_point(log)
    except RecordingError:
        return False
    state = next(
        message.literals
        for payload in truth.payloads.values()
        if isinstance(message := _message(payload), wire.State)
        and message.tick == past.tick
    )
    _demand(past.state == state, f"state to go on from at tick {past.tick}")
    return True


def _message(payload: bytes) -> wire.Message:
    message: wire.Message = msgspec.json.Decoder(wire.Message).decode(payload)
    return message


def _salvaged(truth: Truth, log: Path, messages: int, derived: int) -> None:
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
    _demand(_derived(out) == derived, f"other ticks salvaged than {derived}")
    out.unlink()


def _demand(held: bool, what: str) -> None:
    if not held:
        raise WrongError(what)


class Tally(NamedTuple):
    """What came of many files; shares are in [0, 1]."""

    files: int = 0
    refused: int = 0
    messages: float = 0.0
    derived: float = 0.0
    learned: float = 0.0
    resumes: int = 0

    def plus(self, truth: Truth, found: Found) -> "Tally":
        """Return it with one more."""
        return Tally(
            self.files + 1,
            self.refused + bool(found.refused),
            self.messages + found.messages / len(truth.payloads),
            self.derived + found.derived / TICKS,
            self.learned + found.learned / TICKS,
            self.resumes + found.resumes,
        )


def one_file(truth: Truth, folder: Path, state: str, kind: str, seed: str) -> Found:
    """Damage one file of a recording, and judge what is left.

    Raises:
        WrongError: Something is given out that is not so; or it crashed.
    """
    chance = random.Random(seed)
    files = dict(truth.files[state])
    name = chance.choice(sorted(files))
    files[name] = KINDS[kind](files[name], chance)
    for path in folder.iterdir():
        path.unlink()
    for each, content in files.items():
        (folder / each).write_bytes(content)
    try:
        return judge(truth, part_path(folder / "run.mcap", 0))
    except Exception as error:
        raise WrongError(f"{seed}: {type(error).__name__}: {error}") from error


def table(tallies: dict[tuple[str, str], Tally]) -> str:
    """Return what came of all files, a line for each state and kind."""
    head = ("files", "refused", "messages", "derived", "learned", "resumes")
    lines = [f"{'':<24}" + "".join(f"{name:>10}" for name in head)]
    for (state, kind), tally in tallies.items():
        shares = (tally.messages, tally.derived, tally.learned, tally.resumes)
        texts = (f"{100 * share / max(1, tally.files):.1f} %" for share in shares)
        cells = (str(tally.files), str(tally.refused), *texts)
        lines.append(
            f"{state + ', ' + kind:<24}" + "".join(f"{cell:>10}" for cell in cells)
        )
    return "\n".join(lines)


def main() -> int:
    """Damage as the command line says; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--files", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--only", default="", help="STATE/KIND/NUMBER of one file")
    given = parser.parse_args()
    tallies: dict[tuple[str, str], Tally] = {}
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="damage-") as made:
        truth = true_run(Path(made))
        folder = Path(made) / "damaged"
        folder.mkdir()
        pairs = [(state, kind) for state in STATES for kind in KINDS]
        for number in range(given.first, given.first + given.files):
            state, kind = pairs[number % len(pairs)]
            seed = f"{given.seed}/{state}/{kind}/{number}"
            if given.only and given.only != seed.partition("/")[2]:
                continue
            try:
                found = one_file(truth, folder, state, kind, seed)
            except WrongError as error:
                wrong += 1
                print(error, file=sys.stderr, flush=True)
                continue
            tally = tallies.get((state, kind), Tally())
            tallies[state, kind] = tally.plus(truth, found)
            if found.refused and given.only:
                print(found.refused)
            if (number + 1) % 500 == 0:
                print(f"{number + 1} files so far", file=sys.stderr, flush=True)
    print(table(tallies))
    print(f"{given.files} files, {wrong} with something wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
