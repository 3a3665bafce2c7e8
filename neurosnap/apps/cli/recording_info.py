"""A summary of a recording, as data and as text.

Of a finished recording everything is known from its frame and its totals, without
unpacking a chunk, but for the sensors it has grown: if there is room for any, its
decisions are read. One that was cut short or is damaged is read through.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from datetime import timedelta
from itertools import pairwise

import msgspec
from rich.filesize import decimal

from neurosnap import wire
from neurosnap.apps.cli.terminal_output import fields, in_ranges, printable, table
from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.format.records import Cut, damaged_in
from neurosnap.recording.read.recording import Recording, begun, first_path, part_paths
from neurosnap.recording.replay.grown_sensors import RecordedBirth, births_of
from neurosnap.sources.live.statistics import Statistics, outage_line, received_line
from neurosnap.sources.mcap_file import Field, Topic
from neurosnap.sources.open import is_live, lost_by
from neurosnap.system.local_time import local

_SECOND = 10**9


class Info(msgspec.Struct, frozen=True):
    """The summary of a recording."""

    path: str
    size: int
    messages: int
    start: int
    """When the first message was recorded, nanoseconds since the epoch; 0: none."""
    end: int
    """When the last one was."""
    duration: float
    """Seconds from `start` to `end`."""
    chunks: int
    channels: dict[str, int]
    """The messages of each topic that has any."""
    metadata: dict[str, str]
    """What was written of the run at its start."""
    totals: dict[str, str] | None
    """What was written at its end, but for the balance; None if it had none."""
    completeness: Completeness
    """Whether anything is missing. Without totals only losses before the last message
    of each sender are known."""
    cut: Cut | None
    """Where the file was cut short; None for a finished one."""
    files: tuple[str, ...] = ()
    """The files there are of the run, where there may be several."""
    in_force: dict[str, float | str] = {}
    """The threshold, and of a discounted snapshot the decay, given or not."""
    damage: tuple[str, ...] = ()
    """What cannot be read; see `Recording.damage`."""
    missing_ticks: tuple[tuple[int, int], ...] = ()
    """The first and the last of ticks without a state, in a damaged recording."""
    births: tuple[RecordedBirth, ...] = ()
    """The sensors that were grown."""
    room: int = 0
    """How many more may be."""
    received: wire.Received = wire.Received()
    """What a live source had received up to the last tick."""
    outages: tuple[wire.Outage, ...] = ()
    """When it could not listen."""
    lost: int = 0
    """How many of its readings are lost; an outage counts as one."""
    zone: str = "UTC"
    """The time zone of the run."""


def describe(recording: Recording) -> Info:
    """Return the summary of a recording.

    Raises:
        RecordingError: It is not what a writer of ours writes.
    """
    layout = recording.files[-1].layout
    if layout.indexed and recording.totals is not None:
        counts = _noted_counts(recording)
        start = min((chunk.start for chunk in layout.chunks), default=0)
        end = max((chunk.end for chunk in layout.chunks), default=0)
        completeness = recording.noted().completeness
    else:
        counts, start, end, completeness = _read_through(recording)
    run = None
    with suppress(RecordingError):  # its options are missing, or not valid
        run = recording.options
    births = None if run is None else births_of(recording)
    received, outages = _intake(recording, run)
    damage = recording.damage
    if recording.part is not None:
        damage += begun(part_paths(recording.path))
    balance = ("completeness", "expected")
    totals = recording.totals
    return Info(
        path=str(recording.path),
        size=layout.size,
        messages=counts.total(),
        start=start,
        end=end,
        duration=(end - start) / _SECOND,
        chunks=len(layout.chunks),
        channels={topic: counts[topic] for topic in wire.TOPICS if counts[topic]},
        metadata=recording.metadata,
        totals=totals and {k: v for k, v in totals.items() if k not in balance},
        completeness=completeness,
        cut=recording.cut,
        files=_files(recording),
        in_force={} if run is None else run.in_force,
        damage=damage,
        missing_ticks=tuple(_missing_ticks(recording)) if damage else (),
        births=births.listed if births else (),
        room=births.room if births else 0,
        received=received,
        outages=outages,
        lost=0 if run is None else lost_by(run.source, Statistics(received)),
        zone="UTC" if run is None else run.zone,
    )


def _intake(
    recording: Recording, run: RunOptions | None
) -> tuple[wire.Received, tuple[wire.Outage, ...]]:
    """Return what a live source had received in the end, and when it did not listen."""
    received, outages = wire.Received(), list[wire.Outage]()
    if run is not None and is_live(run.source):
        for seen in recording.all("observation", wire.Observation):
            received, outages = seen.received, [*outages, *seen.outages]
    return received, tuple(outages)


def _run(info: Info) -> dict[str, str]:
    """Return what is shown of a run: values as they were in force."""
    # These say of each sensor again what `sensors` says.
    shown = {k: v for k, v in info.metadata.items() if k not in ("options", "body")}
    for name in [name for name, value in shown.items() if value == "null"]:
        value = info.in_force.get(name)
        shown[name] = "none" if value is None else f"{value} (the default)"
    return shown


def _missing_ticks(recording: Recording) -> Iterator[tuple[int, int]]:
    """Yield the ticks without a state, up to the last that has one."""
    there = {state.tick for state in recording.all("state", wire.State)}
    for before, after in pairwise([recording.begins, *sorted(there)]):
        if after > before + 1:
            yield before + 1, after - 1


def _files(recording: Recording) -> tuple[str, ...]:
    """Return the names of the files of a run, itself among them."""
    if recording.part is None:
        return ()
    log = first_path(recording.path, recording.part)
    return tuple(path.name for path in part_paths(log).values())


def _noted_counts(recording: Recording) -> Counter[str]:
    """Count the messages of each topic by the indexes behind the chunks."""
    file, counts = recording.files[-1], Counter[str]()
    topics = file.topics
    for chunk in file.layout.chunks:
        for channel, count in chunk.counts.items():
            if (topic := topics.get(channel)) is None:
                rule, got = "an index must be of a topic", f"channel {channel}"
                raise damaged_in(recording.path, chunk, rule, got)
            counts[topic] += count
    return counts


def _read_through(
    recording: Recording,
) -> tuple[Counter[str], int, int, Completeness]:
    """Count the messages of each topic by reading them; also start, end, balance."""
    counts: Counter[str] = Counter()
    sequences = recording.blank_sequences()
    start, end = 0, 0
    for message, _, sequence, _, log_time in recording.messages():
        counts[wire.topic(message.key)] += 1
        sequences.receive(message.sender, sequence)
        start = min(start or log_time, log_time)
        end = max(end, log_time)
    return counts, start, end, recording.balance(sequences)


def render(info: Info) -> Iterator[str]:
    """Yield `info` in lines: what is missing, then the run, then the file."""
    yield from _balance(info)
    if info.births or info.room:
        yield f"grown: {len(info.births)}, room for {info.room} more"
        yield from table(map(_birth, info.births))
    for title, texts in (
        ("run:", _run(info)),
        ("totals:", info.totals or {}),
    ):
        if texts:
            yield title
            yield from fields(texts, "  ")
    duration = timedelta(microseconds=(info.end - info.start) // 1000)
    yield from fields(
        {
            "messages:": info.messages,
            "duration:": duration,
            "start:": _moment(info.start, info.zone),
            "end:": _moment(info.end, info.zone),
            "size:": f"{decimal(info.size)} in {info.chunks} chunks",
        }
    )
    if info.channels:
        yield "channels:"
        yield from fields(info.channels, "  ")


def messages_of(topics: Sequence[Topic], found: Sequence[Field]) -> Iterator[str]:
    """Yield the lines about the messages of another program."""
    rows = [(one.topic, f"{one.messages:,}", f"{one.every:.3g} s") for one in topics]
    yield from table([("topic", "messages", "every"), *rows], numbers=True)
    yield ""
    told = [
        (one.field, one.says, ", ".join(one.sensors) or "left out") for one in found
    ]
    yield from table([("field", "says", "sensors"), *told])


def _birth(birth: RecordedBirth) -> tuple[str, ...]:
    """Return which sensor was grown, and when."""
    return (
        f"  {'tick' if birth.exact else 'by tick'} {birth.tick}",
        f"sensor {birth.sensor}",
        birth.name,
        "" if birth.history is None else f"from {birth.history} ticks",
        "" if birth.retired is None else f"retired at tick {birth.retired}",
    )


def _balance(info: Info) -> Iterator[str]:
    """Say whether it is all there."""
    if info.files:
        yield f"files: {len(info.files)}"
        yield from (f"  {printable(name)}" for name in info.files)
    if (cut := info.cut) is not None:
        place = f"at byte {cut.offset} of {cut.size}"
        yield f"cut short: after {cut.chunks} whole chunks, {place}"
    yield from (f"damaged: {printable(line)}" for line in info.damage)
    if info.missing_ticks:
        yield f"missing ticks: {in_ranges(info.missing_ticks)}"
    missing = info.completeness.missing
    yield f"missing: {sum(missing.values())}"
    yield from fields(missing, "  ")
    yield f"duplicates: {info.completeness.duplicates} left out"
    yield f"foreign: {info.completeness.foreign} left out"
    if info.received.total:
        yield received_line(msgspec.structs.asdict(info.received))
    yield from (outage_line(outage, info.zone) for outage in info.outages)


def _moment(nanoseconds: int, zone: str) -> str:
    """Return a time as RFC 3339, by a zone's clock; of no clock the last there is."""
    latest = 2**63 - 1
    moment = local(min(nanoseconds, latest) / _SECOND, zone)
    return moment.isoformat(timespec="milliseconds")
