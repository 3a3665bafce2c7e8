"""Damage to payloads and recordings that respects their structure.

Bytes changed at random mostly fail the first check there is. So a value takes the place
of another, a record that of another, and a recording's checksums are right again when
all is done, or say that there are none: what the damage meets is the code behind them.
"""

import io
import random
import re
import struct
import zlib
from collections.abc import Sequence

import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Metadata

from neurosnap.recording.format.records import CHUNK_HEAD, FOOTER, HEAD, MAGIC

_NASTY = (
    b"NaN",
    b"Infinity",
    b"-1",
    b"1e400",
    b"0.1",
    b"null",
    b"true",
    b'""',
    b'"\\ud800"',
    b"9" * 5000,
    b"[" * 2000,
    b'{"a":' * 2000,
    b"[]",
    b'"\xed\xa0\x80"',
    b'"\\u0000"',
    b"-0",
    b"2147483648",
    b"18446744073709551616",
    b"[" + b"7," * 3000 + b"7]",
)
_BLOCK = 4096
_TOKEN = re.compile(rb'-?\d+|"[^"]*"|\[[^]]*\]|true|false')


WAYS = range(8)
DISK_WAYS = (0, 1, 6, 7)
"""The ways of `damage` in which a disk damages a file."""


def damage(
    whole: bytes, other: bytes, chance: random.Random, ways: Sequence[int] = WAYS
) -> bytes:
    """Return `whole` with bits flipped, or cut, or with something else in it."""
    at = chance.randrange(len(whole) + 1)
    to = min(len(whole), at + chance.choice((1, 4, 8, 100)))
    match chance.choice(ways):
        case 0:
            flipped = bytes(byte ^ (1 << chance.randrange(8)) for byte in whole[at:to])
            return whole[:at] + flipped + whole[to:]
        case 1:
            return whole[:at]
        case 2:
            return whole[:at] + whole[to:]
        case 3:
            return whole[:to] + whole[at:]
        case 4:
            return whole[:at] + other[chance.randrange(len(other) + 1) :]
        case 5:
            return whole[:at] + chance.randbytes(to - at) + whole[to:]
        case 6:  # a block of zeros, where a disk has its blocks
            start = at // _BLOCK * _BLOCK
            gone = len(whole[start : start + _BLOCK])
            return whole[:start] + bytes(gone) + whole[start + gone :]
        case _:  # zeros at the end, as after a power cut
            return whole[:at] + bytes(len(whole) - at)


def damage_json(whole: bytes, other: bytes, chance: random.Random) -> bytes:
    """Return a payload with a value replaced, a key doubled, or damaged as bytes."""
    for _ in range(chance.choice((1, 1, 2))):
        tokens = list(_TOKEN.finditer(whole))
        if not tokens or chance.random() < 0.3:
            whole = damage(whole, other, chance)
            continue
        token = chance.choice(tokens)
        start, end = token.span()
        if chance.random() < 0.2 and whole.endswith(b"}"):
            unknown = b'"unknown":' + chance.choice(_NASTY)
            again = whole[whole.find(b'"') : -1]
            whole = whole[:-1] + b"," + chance.choice((again, unknown)) + b"}"
        elif chance.random() < 0.5:
            nasty = chance.choice(_NASTY)
            whole = whole[:start] + nasty + whole[end:]
        else:
            taken = chance.choice(list(_TOKEN.finditer(other)) or tokens)[0]
            whole = whole[:start] + taken + whole[end:]
    return whole


_START = len(MAGIC)
_MESSAGE = 22  # bytes of a message before its payload

Records = list[tuple[int, bytes]]


def damage_recording(whole: bytes, chance: random.Random) -> bytes:
    """Return a recording damaged below its checksums: most often they are right again.

    Otherwise they are 0, which says that none was computed.
    """
    found = records(whole[_START:-_START])
    for _ in range(chance.choice((1, 1, 3))):
        _damage_one(found, chance)
    return resealed(found, checksums=chance.random() < 0.8)


def records(data: bytes) -> Records:
    """Return the opcodes and bodies in `data`, up to where it makes no sense."""
    found, at = [], 0
    while at + HEAD.size <= len(data):
        kind, length = HEAD.unpack_from(data, at)
        at += HEAD.size
        found.append((kind, data[at : at + length]))
        at += length
    return found


def resealed(found: Records, *, checksums: bool = True) -> bytes:
    """Return the file of these records; its end fits what is before.

    Args:
        found: From the header to the footer.
        checksums: Those of data and summary are right, and not 0.
    """
    file, begins = bytearray(MAGIC), 0
    for kind, body in found:
        if kind == Opcode.DATA_END:
            checksum = zlib.crc32(file) if checksums else 0
            file += _joined([(kind, struct.pack("<I", checksum))])
            begins = len(file)
        elif kind == Opcode.FOOTER and len(body) == FOOTER.size:
            end = _joined([(kind, struct.pack("<Q", begins) + body[8:])])[:-4]
            checksum = zlib.crc32(file[begins:] + end) if checksums else 0
            file += end + struct.pack("<I", checksum)
        else:
            file += _joined([(kind, body)])
    return bytes(file + MAGIC)


def _joined(found: Records) -> bytes:
    return b"".join(HEAD.pack(kind, len(body)) + body for kind, body in found)


def _damage_one(found: Records, chance: random.Random) -> None:
    """Damage one of the records, or put it elsewhere; most often a chunk."""
    if not found:
        return
    chunks = [at for at, (kind, _) in enumerate(found) if kind == Opcode.CHUNK]
    at = chance.choice(
        chunks if chunks and chance.random() < 0.6 else range(len(found))
    )
    kind, body = found[at]
    other = chance.choice(found)[1]
    if chance.random() < 0.1:
        found.insert(chance.randrange(len(found)), found.pop(at))
    elif kind == Opcode.CHUNK and chance.random() < 0.9:
        found[at] = kind, _damage_chunk(body, chance)
    elif kind == Opcode.MESSAGE and chance.random() < 0.9:
        payload = damage_json(body[_MESSAGE:], other[_MESSAGE:], chance)
        found[at] = kind, body[:_MESSAGE] + payload
    elif kind == Opcode.METADATA and chance.random() < 0.9:
        found[at] = kind, _damage_metadata(body, chance)
    else:
        found[at] = kind, damage(body, other, chance)


def _damage_chunk(body: bytes, chance: random.Random) -> bytes:
    """Damage a record in a chunk, and pack all again."""
    start, end, size, _, name = CHUNK_HEAD.unpack_from(body.ljust(CHUNK_HEAD.size))
    inside = body[CHUNK_HEAD.size + name + 8 :]
    if name:
        try:
            inside = zstandard.decompress(inside, max_output_size=size)
        except zstandard.ZstdError:  # it was damaged before
            return damage(body, body, chance)
    found = records(inside)
    _damage_one(found, chance)
    inside = _joined(found)
    compression = chance.choice((b"", b"zstd"))
    packed = zstandard.compress(inside) if compression else inside
    head = CHUNK_HEAD.pack(
        start, end, len(inside), zlib.crc32(inside), len(compression)
    )
    return head + compression + len(packed).to_bytes(8, "little") + packed


def _damage_metadata(body: bytes, chance: random.Random) -> bytes:
    """Put something else in the place of a fact."""
    try:
        metadata = Metadata.read(ReadDataStream(io.BytesIO(body)))
    except (McapError, struct.error, UnicodeDecodeError):  # it was damaged before
        return damage(body, body, chance)
    if metadata.metadata:
        name = chance.choice(list(metadata.metadata))
        nasty = chance.choice(_NASTY).decode(errors="replace")
        metadata.metadata[name] = chance.choice(
            (nasty, nasty, metadata.metadata[name] * 2)
        )
    builder = RecordBuilder()
    metadata.write(builder)
    return bytes(builder.end())[HEAD.size :]
