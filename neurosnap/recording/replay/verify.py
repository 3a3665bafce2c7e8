"""Verifies a recording: replays each stretch of it, and reports the result.

Or derives it under other options, in this process, and says where it departs from what
was recorded. The readings and the actions taken stay: a decision is what an agent of
those options would have decided there.
"""

import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from operator import attrgetter
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import body_after, changes_in
from neurosnap.errors import RecordingError
from neurosnap.protocol import anomaly_report as report
from neurosnap.protocol.anomaly_detector import AnomalyDetector
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.recording.read.recorded_readings import alarms_of
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.replay_starts import starts
from neurosnap.recording.read.stretches import stretches
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.replay.compare_derived import DifferenceError, Replay, start_of
from neurosnap.sensorium import unpack, unpack_readings
from neurosnap.system.compiled import interpreted

_JUDGED = "alarms", "zone", "health_step"
_WORDS = "unknown", "off", "on", "both"


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """The result of verifying a recording."""

    files: int
    """How many files it is recorded in."""

    same: bool
    """Everything derived equals what was recorded."""
    complete: bool
    """The recording was finished, is not damaged, and lacks no message."""
    difference: str | None
    """The first difference: where, what was recorded, what was derived."""
    start: int
    """The tick of the key-frame it began with, 0: it began with the run."""
    ticks: int
    """Whole ticks that were compared."""
    wirings: int
    """Wirings that were compared, and so on."""
    waves: int
    states: int
    decisions: int
    seconds: float
    """What it took."""
    ranges: tuple[tuple[int, int], ...] = ()
    """The first and the last tick of each stretch that was compared."""
    missing: tuple[tuple[int, int], ...] = ()
    """The first and the last of the ticks in between that cannot be derived."""
    damage: tuple[str, ...] = ()
    """What cannot be read; see `Recording.damage`."""


def verify(path: Path, tick: int = 0) -> Verdict:
    """Replay a recording and compare.

    Memory is bounded by what arrived out of order. Time: a small fraction of the run's.

    Args:
        path: A recording, or the first of its files for all of them. A later file is
            verified alone, from the key-frame that it begins with.
        tick: Begin with the last key-frame that is not after it; 0: with the first
            message there is.

    Raises:
        RecordingError: It cannot be read, or no key-frame is there to begin with.
    """
    began = time.perf_counter()
    recording = Recording.open(path)
    count: Counter[str] = Counter()
    ranges: list[tuple[int, int]] = []
    difference, first = None, 0
    with interpreted(recording.options.briefly):
        for replay in _replays(recording, tick):
            try:
                for _ in replay.ticks():
                    pass
            except DifferenceError as error:
                difference = str(error)
            count.update(replay.compared)
            if not ranges:
                first = replay.first
            if replay.core.tick > replay.first:
                ranges.append((replay.first + 1, replay.core.tick))
            if difference is not None:
                break
    return Verdict(
        files=len(recording.files),
        same=difference is None,
        complete=recording.whole,
        difference=difference,
        start=first,
        ticks=sum(last - first + 1 for first, last in ranges),
        wirings=count["wiring"] + count["workerwiring"],
        waves=count["wavestart"],
        states=count["state"],
        decisions=count["decision"],
        seconds=time.perf_counter() - began,
        ranges=tuple(ranges),
        missing=tuple(_between(recording, first, ranges)),
        damage=recording.damage,
    )


def _replays(recording: Recording, tick: int) -> Iterator[Replay]:
    """Yield replays, each to be iterated over before the next, of all there is.

    Where one can derive no more, the next begins with the key-frame behind.
    """
    several = stretches(recording)
    if not several:
        rule = "must hold a key-frame behind what is missing"
        raise RecordingError(f"{recording.path}: {rule}, got none")
    for stretch, after in zip_longest(several, several[1:]):
        if after is not None and after.begins <= tick:
            continue
        start = start_of(stretch, tick)
        while True:
            replay = Replay(stretch, start)
            yield replay
            reached = replay.core.tick
            behind = (s for s in starts(stretch) if s.frame.tick > reached)
            if replay.complete or (start := next(behind, None)) is None:
                break


def _between(
    recording: Recording, first: int, ranges: list[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    """Yield the ticks that are missing, those behind the last range included."""
    reached = first
    if not first and recording.begins:
        reached = recording.begins
    for start, stop in ranges:
        if start > reached + 1:
            yield reached + 1, start - 1
        reached = stop
    if recording.damage and (last := TickIndex(recording).last_tick()) > reached:
        yield reached + 1, last


def departures(recording: Recording, options: RunOptions) -> Iterator[dict[str, str]]:
    """Yield for each tick what departs, and how: states, decisions, anomalies, alarms.

    A grown sensor is held against one of its number and name. The last tick is the last
    that can be derived; the recording has to begin with its run.

    Raises:
        InvalidValueError: There can be no run of such options.
        RecordingError: It is damaged, or does not begin with its run.
    """
    if recording.begins:
        rule = "must begin with the run, as other options learn from its first tick on"
        raise RecordingError(f"{recording.path}: {rule}, got tick {recording.begins}")
    snapshot, memory = options.new_snapshot(), options.new_memory()
    snapshot.assume(options.known_order)
    agent = Agent(options.body, options.new_policy(memory), snapshot, memory)
    old, theirs, own = recording.options, options.body, len(options.body.own)
    count = theirs.count
    detector = AnomalyDetector(count, options.hold, options.support)
    told, frames = dict[int, wire.Anomaly](), set[int]()
    for recorded in recording.messages(("anomaly", "keyframe")):
        if isinstance(message := recorded.message, wire.Anomaly):
            told[message.tick] = message
        elif isinstance(message, wire.KeyFrame):
            frames.add(message.tick)
    alarms, judged = [_alarms(recording, old)] * 2, attrgetter(*_JUDGED)
    if judged(options) != judged(old):
        alarms[0] = _alarms(recording, options)
    for number, each in enumerate(ticks(recording), start=1):
        if (seen := each.observation) is None or each.number != number:
            return
        bits, known = unpack_readings(seen.bits, seen.known, count)
        if seen.cut:
            agent.set_down()
        sure = None if known is None else known[:own]
        sensed, body = agent.sense(bits[:own], seen.begins, sure), agent.body
        found = None
        if options.watch:
            order = snapshot.poc_graph()
            found = detector.watch(number, order, sensed.bits, sensed.known, snapshot)
            if number in frames:
                detector.to_bytes()  # there it forgets
        decision = agent.follow(sensed)
        mine = {"anomalies": _reported(found, options, body)}
        its = {"anomalies": _reported(told.get(number), old, theirs)}
        mine["alarms"], its["alarms"] = (some.get(number, "") for some in alarms)
        if each.state is not None:
            states = agent.state, unpack(each.state.literals, 2 * count)
            # What came or went with the decision did so in the agent's state already.
            new = decision.born, decision.retires
            mine["states"], its["states"] = _believed(states, (body, theirs), new)
        if each.decision is not None:
            theirs = body_after(theirs, each.decision)
            mine["decisions"] = _decided(decision, agent.body)
            its["decisions"] = _decided(each.decision, theirs)
            agent.take(each.decision.action)
        yield {
            kind: f"{one or 'none'} (recorded {its[kind] or 'none'})"
            for kind, one in mine.items()
            if one != its[kind]
        }
        if each.decision is None:
            return


def _alarms(recording: Recording, options: RunOptions) -> dict[int, str]:
    """Return the alarms that some options raise, and their ends, by tick."""
    found = defaultdict[int, list[str]](list)
    for number, news in alarms_of(recording, options):
        found[number].append(news.line())
    return {number: "; ".join(lines) for number, lines in found.items()}


def _reported(anomaly: wire.Anomaly | None, options: RunOptions, body: Body) -> str:
    """Return an anomaly in words, without numbers; empty if none is reported."""
    rest = anomaly and report.with_support(anomaly, options.support)
    if rest is None:
        return ""
    plain = msgspec.structs.replace(rest, numbers=())
    return report.anomaly_line(report.named_anomaly(plain, body))


def _believed(
    states: Iterable[NDArray[np.bool_]], bodies: Iterable[Body], new: tuple[int, int]
) -> list[str]:
    """Return in words what two states say of the sensors on which they differ."""
    codes = [(2 * state[::2] + state[1::2]).tolist() for state in states]
    rows = zip(*(body.sensors for body in bodies), *codes, strict=True)
    apart = [
        (name, words)
        for k, (name, other, *words) in enumerate(rows)
        if name == other and words[0] != words[1] and k not in new
    ]
    return [
        report.few([f"{name} {_WORDS[words[k]]}" for name, words in apart])
        for k in (0, 1)
    ]


def _decided(decision: wire.Decision, body: Body) -> str:
    """Return in words what was decided; the body is the one after it."""
    action = dict(enumerate(body.actions)).get(decision.action, "no action")
    changes = changes_in(decision, body)
    words = (f"{'retires' if one.retires else 'grows'} {one.name}" for one in changes)
    return ", ".join((action, *words))
