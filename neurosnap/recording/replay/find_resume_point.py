"""Finds where a recorded run can resume, and restores its coordinator.

The new recording starts as a copy of the old one up to that tick and goes on from
there, so it is whole by itself: it replays, and resumes, like any other. What the old
one holds beyond the last whole tick is left out, and so are last words. Of a run that
is recorded in several files that goes for the last one only.

What has to be derived again begins at a key-frame behind which every part was heard:
as a rule it takes the same time however long the run was.
"""

import itertools
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import body_after
from neurosnap.errors import RecordingError
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.resume_point import ResumePoint, seen_after
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import (
    Recording,
    first_path,
    has_only_begun,
    part_path,
    part_paths,
)
from neurosnap.recording.read.replay_starts import Start, last_start, starts
from neurosnap.recording.read.stretches import stretches
from neurosnap.recording.replay.compare_derived import (
    DifferenceError,
    Replay,
    lacks_key_frame,
    start_of,
)
from neurosnap.sensorium import pack
from neurosnap.system.compiled import interpreted

_DATED = (
    wire.Pulse
    | wire.CellReport
    | wire.PulseBatch
    | wire.WorkerReport
    | wire.State
    | wire.Reached
)
_TICKED = wire.Observation | wire.Recall | wire.Recalled | wire.Reminder | wire.Image


class _Point(NamedTuple):
    """How far a recording can be derived."""

    tick: int
    """The last whole tick."""
    waves: int
    """Waves started by then."""
    state: bytes
    """The state after it, packed."""


class _UnprovedError(RecordingError):
    """A file begins with a tick that it, or the one before, may lack something of."""


def find_resume_point(
    log: Path, most: int | None = None
) -> tuple[RunOptions, ResumePoint]:
    """Find out where a recorded run can go on.

    Derives the run again on the way, from its last key-frame but one: what is resumed
    is known to be right since then.

    Args:
        log: Its recording; of several files the first, or the last.
        most: Go on from no tick after this one. A run that goes on as it was
            has to leave its last tick to be done: its end is a part of that.

    Raises:
        RecordingError: There is no whole tick in it, it lacks messages before the last
            one, or it is not the run it says it is.
    """
    files = _files(log, most)
    damaged = any(file.damage for file in files)
    why: RecordingError | None = None
    lacks = False  # the file looked at, at its end
    try:
        # What lies behind damage may lack a key-frame to begin with, or the actions on
        # the way there; then it is what lies before.
        for last in reversed(files):
            unproved = False
            for stretch in reversed(stretches(last)):
                try:
                    return _resume_point_in(last, stretch, lacks, most)
                except RecordingError as error:
                    why = why or error
                    unproved = unproved or isinstance(error, _UnprovedError)
            if not (unproved or damaged):
                break
            lacks = unproved
        raise why or RecordingError(
            f"{log}: must hold a whole tick to go on from, got none"
        )
    finally:
        # Its traceback has this frame, and a replay with an open file: kept in the
        # frame, it would keep both until the next collection.
        del why


def _resume_point_in(
    recording: Recording, stretch: Recording, lacks: bool, most: int | None
) -> tuple[RunOptions, ResumePoint]:
    """Find out where a run can go on in one stretch of its last file.

    Args:
        recording: The file.
        stretch: Of it.
        lacks: Its end may be missing, whatever it says.
        most: As in `find_resume_point`.
    """
    tick, waves, state = _derive(stretch, most, lacks)
    actions, body = _taken(recording, tick)
    return recording.options, ResumePoint(
        log=str(recording.path),
        tick=tick,
        actions=actions,
        state=state,
        counts=_counts(recording, stretch, tick, waves),
        resumed=(*(t for t in recording.resumed if t < tick), tick),
        part=recording.part or 0,
        begins=recording.begins,
        grown=body.grown,
        retired=body.retired,
        received=_received(recording, tick),
        seen=_seen(stretch, tick),
    )


def whole_ticks(log: Path) -> int:
    """Return how far a recorded run can go on, in ticks; 0: it cannot."""
    with suppress(RecordingError):
        return find_resume_point(log)[1].tick
    return 0


def _files(log: Path, most: int | None) -> list[Recording]:
    """Open the files there are of a run, up to the one to go on from.

    It is the last of which the one before is finished: that may lack what a later one
    is based on otherwise. Where it does lack something, the one before it is.
    """
    files: list[Recording] = []
    for path in part_paths(log).values():
        if files and has_only_begun(path):
            break
        recording = Recording.open_file(path)
        if path == log and recording.part != 0:
            return [recording]
        if most is not None and files and recording.begins > most:
            break
        files.append(recording)
        if recording.cut is not None:
            break
    if len(files) > 1 and files[-1].files[0].share is None:
        del files[-1]  # its beginning did not reach the disk, its name did
    if len(files) > 1 and not files[-2].noted().completeness.whole:
        del files[-1]
    return files or [Recording.open_file(log)]  # which says why not


def _derive(recording: Recording, most: int | None, lacks: bool = False) -> _Point:
    """Find the last whole tick.

    Args:
        recording: A file, or a stretch of it.
        most: As in `find_resume_point`.
        lacks: Its end may be missing, whatever it says.
    """
    replay = Replay(recording, _start(recording, most))
    replay.complete = replay.complete and not lacks
    core, point = replay.core, None
    opens = bool(replay.first) and replay.first == recording.begins
    if opens:
        point = _Point(core.tick, core.totals.waves, pack(core.snapshot.state))
    with interpreted(replay.options.briefly):
        for tick in _ticks(replay, most):
            # Here and not behind the last one: the core has gone on by then.
            point = _Point(tick, core.totals.waves, pack(core.snapshot.state))
    if opens:
        _prove(recording)
    if point is None and replay.first:
        # Nothing shows that all before the key-frame is there: so that is derived, too.
        return _derive(recording, replay.first, lacks)
    if point is None:
        rule = "must hold a whole tick to go on from"
        raise RecordingError(f"{recording.path}: {rule}, got none")
    return point


def _prove(recording: Recording) -> None:
    """Derive the file before one up to where this begins, unless all report in this.

    For why see `_start`.
    """
    number = recording.part or 0
    if not number or recording.files[0].lost:  # it is known that something is missing
        return
    share, later = recording.files[0].share or {}, _begun_after(recording)
    silent = [who for who, wave in _reported(recording).items() if not wave]
    if all(later.get(who, 0) > share.get(who, 0) for who in silent):
        return
    before = part_path(first_path(recording.path, number), number - 1)
    if not before.exists():  # archived: so it is taken at its word
        return
    reached = 0
    with suppress(RecordingError):
        for stretch in stretches(Recording.open_file(before))[-1:]:
            reached = _derive(stretch, None, lacks=True).tick
    if reached < recording.begins:
        raise _UnprovedError(
            f"{recording.path}: must follow a file that is whole up to tick"
            f" {recording.begins}, got {before} with {reached}"
        )


def _ticks(replay: Replay, most: int | None) -> Iterator[int]:
    """Yield the ticks of a replay up to tick `most`."""
    try:
        yield from islice(replay.ticks(), None if most is None else most - replay.first)
    except DifferenceError as error:
        raise RecordingError(f"{replay.path}: must be a true run: {error}") from error


def _start(recording: Recording, most: int | None) -> Start | None:
    """Return the key-frame to derive from; None for the start of the run.

    It is the last one behind which every cell, or worker, has reported, and not the
    last of all. A message that is lost shows in the numbers of what its sender says
    later; where it says nothing later, only in what can no longer be derived. The
    key-frame that a file begins with has all that came before it in another file.
    """
    begun = {
        start.frame.tick: start.frame.waves
        for start in starts(recording)
        if most is None or start.frame.tick <= most
    }
    first = recording.begins
    if first and not begun:
        raise _UnprovedError(str(lacks_key_frame(recording)))
    heard = min(_reported(recording).values(), default=0)
    behind = [tick for tick, waves in begun.items() if waves < heard]
    known = [tick for tick in behind if tick < max(begun)]
    tick = max(known, default=min(begun, default=0) if first else 0)
    return last_start(recording, tick) if tick else None


def _reported(recording: Recording) -> dict[str, int]:
    """Return the last wave that each cell, or worker, reported on; 0: on none."""
    options = recording.options
    count = None
    if options.body.room and not options.sharing:
        count = options.body.first_grown  # the rest is there once it is grown
    last = dict.fromkeys(options.host_names()[:count], 0)
    for recorded in recording.messages(("cellreport", "workerreport")):
        match recorded.message:
            case wire.CellReport(wave=wave) | wire.WorkerReport(wave=wave):
                who = recorded.message.sender
                last[who] = max(last.get(who, 0), wave)
            case _:
                pass
    return last


def _taken(recording: Recording, tick: int) -> tuple[tuple[int, ...], Body]:
    """Return the actions of the ticks before one, and what was sensed at that one."""
    body = recording.options.body
    if not (body.actions or body.room):
        return (-1,) * (tick - 1), body
    files = (*map(Recording.open, _before(recording)), recording)
    said = itertools.chain.from_iterable(
        each.all("decision", wire.Decision) for each in files
    )
    found = {each.tick: each for each in said if 0 < each.tick < tick}
    if len(found) < tick - 1:
        rule = f"must have its decisions of ticks 1 to {tick - 1}, to do them again"
        raise RecordingError(f"{recording.path}: {rule}, got {len(found)}")
    decisions = [found[before] for before in range(1, tick)]
    for decision in decisions if body.room else ():
        body = body_after(body, decision)
    return tuple(decision.action for decision in decisions), body


def _seen(recording: Recording, tick: int) -> tuple[int, int]:
    """Return the first tick observed, and a checksum of all up to one."""
    first = checksum = 0
    for seen in recording.all("observation", wire.Observation):
        if seen.tick <= tick:
            first = first or seen.tick
            checksum = seen_after(checksum, seen.bits, seen.known)
    return first, checksum


def _received(recording: Recording, tick: int) -> wire.Received | None:
    """Return what a live source had received up to a tick; None if that is not said."""
    before = map(Recording.open, reversed(_before(recording)))
    for each in itertools.chain([recording], before):
        for seen in each.all("observation", wire.Observation):
            if seen.tick == tick or seen.received == wire.Received():
                return seen.received
    return None


def _before(recording: Recording) -> list[Path]:
    """Return the files of the run before one."""
    number = recording.part or 0
    paths = part_paths(first_path(recording.path, number))
    return [path for part, path in paths.items() if part < number]


def _counts(
    recording: Recording, stretch: Recording, tick: int, waves: int
) -> dict[str, int]:
    """Return how many messages of each part belong to the ticks up to `tick`.

    Every part's messages of one tick come before those of the next, so each keeps a
    beginning of its running numbers.

    Args:
        recording: A file of a run.
        stretch: Of it: nothing may be missing from where this begins.
        tick: One of its whole ticks.
        waves: The waves started by then.
    """
    if (share := recording.files[0].share) is None:
        rule = "must say what numbers it begins with"
        raise RecordingError(f"{recording.path}: {rule}, was cut before")
    counts, kept = dict(share), recording.blank_sequences()
    for recorded in recording.messages():
        sender = recorded.message.sender
        kept.receive(sender, recorded.sequence)
        if _belongs(recorded.message, tick, waves):
            counts[sender] = max(counts.get(sender, 0), recorded.sequence + 1)
    if stretch is not recording:
        kept = stretch.sequences()
        # What is missing before it has numbers, too, which are not given again.
        for sender, first in kept.first.items() if stretch.begins else ():
            counts[sender] = max(counts.get(sender, 0), first)
    gaps = kept.gaps(_begun_after(recording))
    for sender, ranges in gaps.items():
        if stretch.begins and ranges[0][0] == kept.first.get(sender, 0):
            # That may be from before the file. Its numbers are not given again, so that
            # they stay missing.
            counts[sender] = max(counts.get(sender, 0), ranges.pop(0)[1])
    lacking = {
        sender: count
        for sender, ranges in gaps.items()
        if (
            count := sum(
                max(0, min(stop, counts.get(sender, 0)) - start)
                for start, stop in ranges
            )
        )
    }
    if lacking:
        raise RecordingError(
            f"{recording.path}: must be whole up to tick {tick}, lacks {lacking}"
        )
    return counts


def _belongs(message: wire.Message, tick: int, waves: int) -> bool:
    """Tell whether a message shows that it is of a tick, or of one before."""
    if isinstance(message, wire.Learned):
        return message.tick <= tick and not message.frame
    if isinstance(message, _TICKED):
        return message.tick <= tick
    return isinstance(message, _DATED) and message.wave <= waves


def _begun_after(recording: Recording) -> dict[str, int]:
    """Return the numbers that shares of the next file begin with, if there is one.

    They show what is missing at the end of a file behind which nothing counts.
    """
    number, log = recording.part, first_path(recording.path, recording.part)
    if number is not None:
        # There may be none, or it was cut at its very beginning.
        with suppress(RecordingError):
            return Recording.open_file(part_path(log, number + 1)).files[0].share or {}
    return {}


def restore(past: ResumePoint, ticks: int) -> Coordinator:
    """Return the coordinator's core as it was after the last whole tick.

    Args:
        past: From `find_resume_point`.
        ticks: How many ticks the run is to have in all; more than there are.
    """
    several = stretches(Recording.open_file(Path(past.log)))
    stretch = [one for one in several if one.begins <= past.tick][-1]
    # All from there on was derived when it was looked back.
    before = max(past.tick - 1, stretch.begins)
    replay = Replay(stretch, start_of(stretch, before))
    for _ in _ticks(replay, past.tick):
        pass
    core = replay.core
    core.resume(ticks, replay.bands())
    return core
