"""The recorder of a simulated swarm: a real file, without a clock to flush it by."""

import random
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from neurosnap import wire
from neurosnap.record.past import Past, begin_recording
from neurosnap.record.reader import Recording
from neurosnap.record.sequences import Completeness
from neurosnap.record.writer import Writer


class Recorder:
    """Writes down what it hears, as `neurosnap.record.recorder` does.

    Args:
        log: Where; must not exist yet.
        facts: What the recording says of the run.
        past: What it takes over, where the run goes on from something.
        parts: Whose last word is awaited.
        chunk: Bytes after which a chunk is written.
    """

    def __init__(
        self,
        log: Path,
        facts: Mapping[str, str],
        past: Past | None,
        parts: Collection[str],
        chunk: int,
    ) -> None:
        self._log = log
        self._parts = parts
        self._left: set[str] = set()
        self._time = 0
        # Not packed, so that a file is as long as what it holds says.
        self._writer = Writer(log, compression="none", chunk=chunk)
        begin_recording(self._writer, facts, past)

    def hear(self, deliveries: list[wire.Delivery]) -> None:
        """Write a burst down."""
        for delivery in deliveries:
            self._time += 1
            self._writer.add(delivery, self._time)
            if delivery.key == "leave":
                self._left.add(wire.decode(delivery.key, delivery.payload).sender)

    def finish(self) -> Completeness:
        """End the recording in order; return what it says of itself.

        Who has not said a last word lacks at least that.
        """
        upcoming = self._writer.sequences.upcoming
        return self._writer.finish(
            {}, {who: upcoming(who) + (who not in self._left) for who in self._parts}
        )

    def lose(self, chance: random.Random) -> None:
        """Die: what was on the disk is left, any beginning of the file."""
        self._writer.abandon()
        size = chance.choice([0, 20, *self._ends()])
        with self._log.open("r+b") as file:
            file.truncate(size)

    def _ends(self) -> Iterator[int]:
        """Yield where it can end with some of its chunks, the next one torn or not."""
        for chunk in Recording.open(self._log).layout.chunks:
            yield chunk.offset
            yield chunk.offset + chunk.packed

    def close(self) -> None:
        """Close the file, unless it is."""
        self._writer.abandon()
