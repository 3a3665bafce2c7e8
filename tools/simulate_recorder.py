"""The recorder of a simulated swarm: real files, without a clock to flush them by."""

import random
from collections.abc import Collection, Iterator, Mapping
from functools import partial
from pathlib import Path

from neurosnap import wire
from neurosnap.record.parts import Parts, Split
from neurosnap.record.past import Past
from neurosnap.record.reader import Recording
from neurosnap.record.sequences import Completeness
from neurosnap.record.whole import part_paths
from neurosnap.record.writer import Writer


class Recorder:
    """Writes down what it hears, as `neurosnap.record.recorder` does.

    Args:
        log: Where; must not exist yet.
        facts: What the recording says of the run.
        past: What it takes over, where the run goes on from something.
        parts: Whose last word is awaited.
        chunk: Bytes after which a chunk is written.
        split: How it is spread over files; None: it is one.
    """

    def __init__(
        self,
        log: Path,
        facts: Mapping[str, str],
        past: Past | None,
        parts: Collection[str],
        chunk: int,
        split: Split | None,
    ) -> None:
        self._log = log
        self._parts = parts
        self._left: set[str] = set()
        self._time = 0
        # Not packed, so that a file is as long as what it holds says.
        new_writer = partial(Writer, compression="none", chunk=chunk)
        self._writer = Parts(log, facts, past, split=split, new_writer=new_writer)

    def hear(self, deliveries: list[wire.Delivery]) -> None:
        """Write a burst down."""
        for delivery in deliveries:
            self._time += 1
            message = self._writer.add(delivery, self._time)
            if isinstance(message, wire.Leave):
                self._left.add(message.who)

    def finish(self) -> Completeness:
        """End the recording in order; return what it says of itself.

        Who has not said a last word lacks at least that.
        """
        upcoming = self._writer.upcoming
        return self._writer.finish(
            {}, {who: upcoming(who) + (who not in self._left) for who in self._parts}
        )

    def lose(self, chance: random.Random) -> None:
        """Die: what was on the disk is left, any beginning of each file without end."""
        self._writer.abandon()
        paths = list(part_paths(self._log).values())
        for path in paths:
            if not Recording.open(path).finished:
                # What a run begins with may be lost; a later file begins on the disk.
                torn = [0, 20] if paths == [self._log] else []
                size = chance.choice([*torn, *_ends(path)])
                with path.open("r+b") as file:
                    file.truncate(size)

    def close(self) -> None:
        """Close the files, unless they are."""
        self._writer.abandon()


def _ends(log: Path) -> Iterator[int]:
    """Yield where a file can end with some of its chunks, the next one torn or not."""
    layout = Recording.open(log).layout
    yield layout.size
    for chunk in layout.chunks:
        yield chunk.offset
        yield chunk.offset + chunk.packed
