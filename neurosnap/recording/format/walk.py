"""Walks from record to record of a file, by their heads.

The records in a chunk are walked in `neurosnap.recording.format.chunk_index`, compiled.
"""

from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from neurosnap.recording.format.records import HEAD, LIMIT


class Head(NamedTuple):
    """What stands before the body of a record."""

    opcode: int
    at: int
    """Where the record starts."""
    length: int
    """Bytes of its body."""

    @property
    def after(self) -> int:
        """Where the record ends."""
        return self.at + HEAD.size + self.length


def heads(file: BinaryIO, start: int, end: int) -> Iterator[Head]:
    """Yield the head of each record in a range; then the file stands at the body.

    Cost: a read for each record. Bodies are not read, so nothing is verified but that
    each record fits.

    Args:
        file: Open for reading; it may be moved meanwhile.
        start: Where the first record starts.
        end: The byte behind the last one.

    Raises:
        ValueError: While iterating: the next record is longer than can be.
    """
    at = start
    while at < end:
        file.seek(at)
        data = file.read(HEAD.size)
        if len(data) < HEAD.size:
            raise ValueError(f"a record must have a whole head, got {len(data)} bytes")
        opcode, length = HEAD.unpack(data)
        head = Head(opcode, at, length)
        if length > LIMIT:
            raise ValueError(f"a record must have at most {LIMIT} bytes, got {length}")
        if head.after > end:
            raise ValueError(f"a record must end by byte {end}, got {head.after}")
        yield head
        at = head.after
