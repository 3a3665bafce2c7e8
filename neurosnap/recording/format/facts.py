"""Metadata records with a checksum of their own.

The format has one checksum for all of the data, at their end: in a file that is damaged
anywhere, or has no end, nothing else says whether metadata is right. Metadata without a
checksum is damage.
"""

import zlib
from collections.abc import Mapping

import msgspec
from mcap.records import Metadata

from neurosnap.recording.format.records import GAP, Gap, Layout, parse

CHECKSUM = "crc"
"""The fact that is the checksum of the others."""


def checksum(name: str, facts: Mapping[str, str]) -> str:
    """Return the CRC-32 of metadata, in hexadecimal digits; `CHECKSUM` is left out."""
    texts = sorted((k, v) for k, v in facts.items() if k != CHECKSUM)
    return f"{zlib.crc32(msgspec.json.encode([name, texts])):08x}"


def sealed_facts(name: str, facts: Mapping[str, str]) -> dict[str, str]:
    """Return metadata with its checksum."""
    return {**facts, CHECKSUM: checksum(name, facts)}


def read_facts(body: bytes) -> tuple[str, dict[str, str]]:
    """Return name and content of metadata, verified by its checksum.

    Raises:
        ValueError: It is not what was written.
    """
    metadata: Metadata = parse(Metadata.read, body)
    name, facts = metadata.name, dict(metadata.metadata)
    noted = facts.pop(CHECKSUM, None)
    if noted is None:
        raise ValueError("no checksum")
    if noted != (computed := checksum(name, facts)):
        raise ValueError(f"checksum {computed} for {noted}")
    return name, facts


def take_facts(layout: Layout, offset: int, body: bytes) -> None:
    """File metadata.

    Args:
        layout: What it is of.
        offset: Where the record starts.
        body: Of the record.

    Raises:
        ValueError: It is not what was written.
    """
    name, facts = read_facts(body)
    if name == GAP:
        layout.gaps.append(Gap(offset, facts.get("why", "")))
    layout.metadata[name] = facts
