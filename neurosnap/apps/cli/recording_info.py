"""A summary of a recording, as data and as text.

Of a finished recording everything is known from its frame and its totals, without
unpacking a chunk, but for the sensors it has grown: if there is room for any, its
decisions are read. One that was cut short or is damaged is read through.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import msgspec

from neurosnap import wire
from neurosnap.apps.cli.output import in_ranges
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.format.records import Cut, damaged_in
from neurosnap.recording.read.recording import Recording, first_path, part_paths
from neurosnap.recording.replay.births import RecordedBirth, births_of

_SECOND = 10**9
_CLOCKS_BEGIN = 946_684_800 * _SECOND
"""The year 2000; times before it come from clocks that do not count from 1970."""


class Info(msgspec.Struct, frozen=True):
    """What is in a recording."""

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
    places: dict[str, str] = {}
    """Where parts are, as in `Place.text`, of a swarm on several machines."""
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


def describe(recording: Recording) -> Info:
    """Return what is in a recording.

    Raises:
        RecordingError: It is not what a writer of ours writes.
    """
    layout = recording.files[-1].layout
    if layout.indexed and layout.channels and recording.totals is not None:
        counts = _noted_counts(recording)
        start = min((chunk.start for chunk in layout.chunks), default=0)
        end = max((chunk.end for chunk in layout.chunks), default=0)
        completeness = recording.noted().completeness
    else:
        counts, start, end, completeness = _read_through(recording)
    run = _options(recording.metadata)
    births = None if run is None else births_of(recording)
    damage = recording.damage
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
        totals=_without_balance(recording.totals),
        completeness=completeness,
        cut=recording.cut,
        files=_files(recording),
        places={who: place.text for who, place in recording.files[-1].places.items()},
        in_force={} if run is None else run.in_force,
        damage=damage,
        missing_ticks=tuple(_missing_ticks(recording)) if damage else (),
        births=births.listed if births else (),
        room=births.room if births else 0,
    )


def _options(metadata: dict[str, str]) -> RunOptions | None:
    """Return the options of a run; None if they are missing or not valid."""
    try:
        return msgspec.json.decode(metadata["options"], type=RunOptions)
    except (KeyError, msgspec.MsgspecError):
        return None


def _run(info: Info) -> dict[str, str]:
    """Return what is shown of a run: names once, and values as they were in force."""
    run, texts = _options(info.metadata), dict(info.metadata)
    if run is None:
        return texts
    del texts["options"]  # says all of the others again
    there = [*run.body.sensors[: run.body.size], *(birth.name for birth in info.births)]
    texts["sensors"] = msgspec.json.encode(there).decode()
    body = msgspec.to_builtins(run.body)
    del body["own"]  # the first of the sensors
    if not any(run.body.orders):
        del body["orders"]
    texts["body"] = msgspec.json.encode(body).decode()
    for name in ("threshold", "decay"):
        if texts.get(name) == "null":
            value = info.in_force.get(name)
            texts[name] = "none" if value is None else f"{value} (the default)"
    return texts


def _missing_ticks(recording: Recording) -> Iterator[tuple[int, int]]:
    """Yield the ticks without a state, up to the last that has one."""
    there = {
        recorded.message.tick
        for recorded in recording.messages(("state",))
        if isinstance(recorded.message, wire.State)
    }
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
    layout, counts = recording.files[-1].layout, Counter[str]()
    topics = {
        id_: each.topic.removeprefix("/") for id_, each in layout.channels.items()
    }
    for chunk in layout.chunks:
        for channel, count in chunk.counts.items():
            if (topic := topics.get(channel)) not in wire.TOPICS:
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


def _without_balance(totals: dict[str, str] | None) -> dict[str, str] | None:
    if totals is None:
        return None
    return {
        name: value
        for name, value in totals.items()
        if name not in ("completeness", "expected")
    }


def render(info: Info) -> str:
    """Return `info` as text: what is missing, then the run, then the file."""
    return "\n".join(_lines(info))


def _lines(info: Info) -> Iterator[str]:
    yield from _balance(info)
    yield from _grown(info)
    yield from _texts("run:", _run(info))
    yield from _texts("places:", info.places)
    yield from _texts("totals:", info.totals or {})
    yield from _table(
        (
            ("messages:", str(info.messages)),
            ("duration:", str(timedelta(microseconds=(info.end - info.start) // 1000))),
            ("start:", _moment(info.start)),
            ("end:", _moment(info.end)),
            ("size:", f"{_bytes(info.size)} in {info.chunks} chunks"),
        )
    )
    if info.channels:
        yield "channels:"
    width = max((len(str(count)) for count in info.channels.values()), default=0)
    yield from _table(
        (f"\t{topic}", f"{count:{width}} messages")
        for topic, count in info.channels.items()
    )


def _grown(info: Info) -> Iterator[str]:
    """Say which sensors were grown, and when."""
    if not info.births and not info.room:
        return
    yield f"grown: {len(info.births)}, room for {info.room} more"
    yield from _table(
        (
            f"\t{'tick' if birth.exact else 'by tick'} {birth.tick}",
            f"sensor {birth.sensor}",
            shown(birth.name),
            "" if birth.history is None else f"from {birth.history} ticks",
            "" if birth.retired is None else f"retired at tick {birth.retired}",
        )
        for birth in info.births
    )


def _balance(info: Info) -> Iterator[str]:
    """Say whether it is all there."""
    if info.files:
        yield f"files: {len(info.files)}"
        yield from _table((f"\t{shown(name)}",) for name in info.files)
    if info.cut is not None:
        yield (
            f"cut short: after {info.cut.chunks} whole chunks,"
            f" at byte {info.cut.offset} of {info.cut.size}"
        )
    yield from (f"damaged: {shown(line)}" for line in info.damage)
    if info.missing_ticks:
        yield f"missing ticks: {in_ranges(info.missing_ticks)}"
    missing = info.completeness.missing
    yield f"missing: {sum(missing.values())}"
    yield from _table((f"\t{shown(who)}", str(n)) for who, n in missing.items())
    yield f"duplicates: {info.completeness.duplicates} left out"
    yield f"foreign: {info.completeness.foreign} left out"


def _texts(title: str, texts: dict[str, str]) -> Iterator[str]:
    if texts:
        yield title
    yield from _table((f"\t{shown(k)}:", shown(v)) for k, v in texts.items())


def _table(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Lay out rows in columns as wide as their widest cell."""
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (f"{cell:{width}}" for cell, width in zip(row, widths, strict=True))
        yield "  ".join(cells).rstrip()


def shown(text: str) -> str:
    """Return `text` as it may go to a terminal: a stranger's file may steer one."""
    return text if text.isprintable() else repr(text)


def _bytes(count: float) -> str:
    for unit in ("B", "KiB", "MiB"):
        if count <= 1024:
            return f"{count:.2f} {unit}"
        count /= 1024
    return f"{count:.2f} GiB"


def _moment(nanoseconds: int) -> str:
    """Return a time as RFC 3339 in UTC; one of another clock in seconds."""
    seconds, rest = divmod(nanoseconds, _SECOND)
    plain = f"{seconds}.{rest:09}"
    if nanoseconds < _CLOCKS_BEGIN:
        return plain
    try:
        day = datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, ValueError, OSError):  # beyond the year 9999
        return plain
    digits = f".{rest:09}".rstrip("0") if rest else ""
    return f"{day:%Y-%m-%dT%H:%M:%S}{digits}Z"
