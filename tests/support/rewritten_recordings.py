"""Recordings written again with something changed in them."""

import random
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

import msgspec

from neurosnap import wire
from neurosnap.recording.format.records import Chunk
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from tests.support.recorded_messages import M, first

Change: TypeAlias = Callable[[list[Recorded]], Iterable[Recorded]]


def write_again(
    recording: Recording,
    target: Path,
    recorded: Iterable[Recorded],
    *,
    expected: Mapping[str, int] | None = None,
    chunk: int = 1 << 20,
) -> Path:
    """Record `recorded` as if it had come from the run of `recording`."""
    with Writer(target, chunk=chunk) as writer:
        writer.start(recording.metadata)
        for each in recorded:
            writer.add(each.delivery, each.log_time)
        writer.finish({}, recording.noted().expected if expected is None else expected)
    return target


def rewritten(log: Path, target: Path, change: Change) -> Path:
    recording = Recording.open(log)
    return write_again(recording, target, change(list(recording.messages())))


def saying(recorded: Recorded, **changes: object) -> Recorded:
    """Return `recorded` with its message changed, at the same place and number."""
    message: wire.Message = msgspec.structs.replace(recorded.message, **changes)
    return recorded._replace(message=message, payload=wire.encode(message))


def flipped(data: bytes, bit: int = 0) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def spoil(log: Path, tick: int, *, cut: bool = False) -> Chunk:
    """Damage the chunk in which a tick was observed, and perhaps the end; return it."""
    (file,) = Recording.open_file(log).files
    found = next(
        chunk
        for chunk in file.layout.chunks
        for one in file.chunk(chunk).all("observation", wire.Observation)
        if one.tick == tick
    )
    data = bytearray(log.read_bytes())
    data[found.offset + found.packed // 2] ^= 1
    log.write_bytes(data[: -200 if cut else None])
    return found


def changing(
    kind: type[M], found: Callable[[M], bool], to: Callable[[M], dict[str, object]]
) -> Change:
    """Return the change of the first message of one kind of which `found` is true."""

    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, message = first(recorded, kind, found)
        recorded[place] = saying(recorded[place], **to(message))
        return recorded

    return change


def dropping(
    kind: type[M],
    found: Callable[[M], bool] = lambda _: True,
    *,
    and_after: bool = False,
) -> Change:
    """Return the change that leaves out the first message of one kind, as found.

    With `and_after` all that follows it is left out, too.
    """

    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, _ = first(recorded, kind, found)
        return recorded[:place] + ([] if and_after else recorded[place + 1 :])

    return change


def overtaken(
    messages: Iterable[Recorded], chance: random.Random, reach: int = 12
) -> list[Recorded]:
    """Let senders overtake each other by some messages, each in its own order."""
    due: dict[str, float] = {}
    timed = []
    for place, each in enumerate(messages):
        sender = each.message.sender
        due[sender] = max(due.get(sender, 0.0), place + reach * chance.random())
        timed.append((due[sender], place, each))
    return [each for _, _, each in sorted(timed, key=lambda entry: entry[:2])]
