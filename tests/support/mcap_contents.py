"""What is in a file for viewers, read by MCAP's own library."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.reader import make_reader


def said(path: Path, topic: str) -> list[tuple[int, dict[str, Any]]]:
    """Return the messages of a topic and when they were recorded."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(topics=[topic])
        return [(message.log_time, json.loads(message.data)) for _, _, message in found]


def schemas_in(path: Path) -> dict[str, Any]:
    """Return the schema of each topic."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return {
        channel.topic: json.loads(summary.schemas[channel.schema_id].data)
        for channel in summary.channels.values()
    }


def attached(path: Path) -> Iterator[tuple[str, bytes]]:
    with path.open("rb") as file:
        for each in make_reader(file).iter_attachments():
            yield each.name, each.data
