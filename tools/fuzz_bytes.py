"""Damage to payloads and recordings that respects their structure.

Bytes changed at random mostly fail the first check there is. So a value takes the place
of another, a record that of another, and a recording's checksums are right again when
all is done: what the damage meets is the code behind them.
"""

import io
import random
import re
import struct
import zlib

import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Metadata

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
_TOKEN = re.compile(rb'-?\d+|"[^"]*"|\[[^]]*\]|true|false')


def damage(whole: bytes, other: bytes, chance: random.Random) -> bytes:
    """Return `whole` with bits flipped, or cut, or with something else in it."""
    at = chance.randrange(len(whole) + 1)
    to = min(len(whole), at + chance.choice((1, 4, 8, 100)))
    match chance.randrange(6):
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
        case _:
            return whole[:at] + chance.randbytes(to - at) + whole[to:]


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


_HEAD, _CHUNK = struct.Struct("<BQ"), struct.Struct("<QQQII")
_START = 8  # bytes of the magic before the first record
_MESSAGE = 22  # bytes of a message before its payload

Records = list[tuple[int, bytes]]


def damage_recording(whole: bytes, chance: random.Random) -> bytes:
    """Return a recording damaged below its checksums, which then are right again."""
    records = _records(whole[_START:-_START])
    for _ in range(chance.choice((1, 1, 3))):
        _damage_one(records, chance)
    for at, (kind, body) in enumerate(records):  # 0 says that none was computed
        if kind == Opcode.DATA_END:
            records[at] = kind, bytes(4)
        elif kind == Opcode.FOOTER:
            records[at] = kind, body[:-4] + bytes(4)
    return whole[:_START] + _joined(records) + whole[:_START]


def _records(data: bytes) -> Records:
    """Return the opcodes and bodies in `data`, up to where it makes no sense."""
    records, at = [], 0
    while at + _HEAD.size <= len(data):
        kind, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        records.append((kind, data[at : at + length]))
        at += length
    return records


def _joined(records: Records) -> bytes:
    return b"".join(_HEAD.pack(kind, len(body)) + body for kind, body in records)


def _damage_one(records: Records, chance: random.Random) -> None:
    """Damage one of `records`, or put it elsewhere; most often a chunk."""
    if not records:
        return
    chunks = [at for at, (kind, _) in enumerate(records) if kind == Opcode.CHUNK]
    at = chance.choice(
        chunks if chunks and chance.random() < 0.6 else range(len(records))
    )
    kind, body = records[at]
    other = chance.choice(records)[1]
    if chance.random() < 0.1:
        records.insert(chance.randrange(len(records)), records.pop(at))
    elif kind == Opcode.CHUNK and chance.random() < 0.9:
        records[at] = kind, _damage_chunk(body, chance)
    elif kind == Opcode.MESSAGE and chance.random() < 0.9:
        payload = damage_json(body[_MESSAGE:], other[_MESSAGE:], chance)
        records[at] = kind, body[:_MESSAGE] + payload
    elif kind == Opcode.METADATA and chance.random() < 0.9:
        records[at] = kind, _damage_metadata(body, chance)
    else:
        records[at] = kind, damage(body, other, chance)


def _damage_chunk(body: bytes, chance: random.Random) -> bytes:
    """Damage a record in a chunk, and pack all again."""
    start, end, size, _, name = _CHUNK.unpack_from(body.ljust(_CHUNK.size))
    inside = body[_CHUNK.size + name + 8 :]
    if name:
        try:
            inside = zstandard.decompress(inside, max_output_size=size)
        except zstandard.ZstdError:  # it was damaged before
            return damage(body, body, chance)
    records = _records(inside)
    _damage_one(records, chance)
    inside = _joined(records)
    compression = chance.choice((b"", b"zstd"))
    packed = zstandard.compress(inside) if compression else inside
    head = _CHUNK.pack(start, end, len(inside), zlib.crc32(inside), len(compression))
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
    return bytes(builder.end())[_HEAD.size :]
