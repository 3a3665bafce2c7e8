"""Unpacks chunks, and verifies each by its own checksum."""

import zlib
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.opcode import Opcode

from neurosnap.recording.format.records import CHUNK_HEAD, HEAD, Chunk, damaged


def unpack(path: Path, file: BinaryIO, chunk: Chunk) -> bytes:
    """Return the records of a chunk, verified by the checksum in its own head.

    Raises:
        RecordingError: They are not what was written, or there is no such chunk.
    """
    place = f"chunk {chunk.number}"
    file.seek(chunk.start_offset)
    head, packed = file.read(chunk.head), file.read(chunk.packed)
    if len(head) < chunk.head or head[0] != Opcode.CHUNK:
        rule = f"{place} must start at byte {chunk.start_offset}"
        raise damaged(path, chunk.offset, rule, "another record")
    _, _, unpacked, noted, _ = CHUNK_HEAD.unpack_from(head, HEAD.size)
    if unpacked != chunk.unpacked:
        rule = f"{place} must unpack to {chunk.unpacked} bytes"
        raise damaged(path, chunk.offset, rule, unpacked)
    match chunk.compression:
        case "":
            data = packed
        case "zstd":
            try:
                data = _unpack_zstd(packed, chunk.unpacked)
            except (zstandard.ZstdError, ValueError) as error:
                rule = f"{place} must unpack to {chunk.unpacked} bytes"
                raise damaged(path, chunk.offset, rule, error) from error
        case other:
            rule = f"{place} must be packed with zstd or not at all"
            raise damaged(path, chunk.offset, rule, repr(other))
    # Not even a checksum of 0, which says that none was computed, is let through.
    if (checksum := zlib.crc32(data)) != noted or len(data) != chunk.unpacked:
        rule = f"{place} must have checksum {noted:#010x}"
        raise damaged(path, chunk.offset, rule, f"{checksum:#010x}")
    return data


def _unpack_zstd(packed: bytes, size: int) -> bytes:
    # A frame that claims a size gets it, whatever limit the library is called with;
    # -1 says that it claims none, and then the limit holds.
    claimed = zstandard.frame_content_size(packed)
    if claimed not in (-1, size):
        raise ValueError(claimed)
    return zstandard.decompress(packed, max_output_size=size)
