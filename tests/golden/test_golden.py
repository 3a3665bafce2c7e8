"""The golden recording means what it meant when it was made."""

from pathlib import Path
from typing import Any

import msgspec

from neurosnap import wire
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.recording import Recording
from tests.golden.make import FOLDER, MESSAGES, make, meaning

GOLDEN = FOLDER / "recording.mcap"


def test_it_means_what_it_meant() -> None:
    meant = msgspec.json.decode(GOLDEN.with_suffix(".json").read_bytes())
    means = msgspec.json.encode(meaning(Recording.open(GOLDEN)))
    assert msgspec.json.decode(means) == meant


def test_it_holds_every_kind_of_message() -> None:
    topics = {wire.topic(message.key) for _, message in MESSAGES}
    assert topics == set(wire.TOPICS)


def test_what_is_written_today_means_the_same(tmp_path: Path) -> None:
    assert comparable(make(tmp_path)) == comparable(GOLDEN)


def comparable(path: Path) -> dict[str, Any]:
    """Return what is in a recording, its totals' JSON read."""
    means = meaning(Recording.open(path))
    balance = msgspec.json.decode(means["totals"]["completeness"], type=Completeness)
    return {**means, "totals": {**means["totals"], "completeness": balance}}
