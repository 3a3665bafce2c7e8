"""Walks from record to record of a file, by their heads.

The records in a chunk are walked in `neurosnap.recording.format.chunk_index`, compiled.
"""

from collections.abc import Iterator
from typing import BinaryIO, TypeAlias

from neurosnap.recording.format.records import HEAD, LIMIT

Head: TypeAlias = tuple[int, int, int]
"""Of a record: its kind, where its body starts, and where it ends."""


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
        body = at + HEAD.size
        if len(data) < HEAD.size:
            raise ValueError(f"a record must have a whole head, got {len(data)} bytes")
        opcode, length = HEAD.unpack(data)
        if length > LIMIT:
            raise ValueError(f"a record must have at most {LIMIT} bytes, got {length}")
        at = body + length
        if at > end:
            raise ValueError(f"a record must end by byte {end}, got {at}")
        yield opcode, body, at
