"""Recordings made once stay readable, and mean what they meant."""

from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.record.reader import Recording
from tests.golden.make import FOLDER, MESSAGES, make, meaning

RECORDINGS = sorted(FOLDER.glob("recording-*.mcap"))


def test_every_schema_has_its_recording() -> None:
    names = {path.stem for path in RECORDINGS}
    assert names == {f"recording-{number + 1}" for number in range(wire.SCHEMA)}


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda path: path.stem)
def test_it_means_what_it_meant(path: Path) -> None:
    meant = msgspec.json.decode(path.with_suffix(".json").read_bytes())
    means = msgspec.json.encode(meaning(Recording.open(path)))
    assert msgspec.json.decode(means) == meant


def test_it_holds_every_kind_of_message() -> None:
    topics = {wire.topic(message.key) for _, message in MESSAGES}
    assert topics == set(wire.TOPICS)


def test_what_is_written_today_means_the_same(tmp_path: Path) -> None:
    newest = FOLDER / f"recording-{wire.SCHEMA}.mcap"
    path = make(tmp_path)
    assert meaning(Recording.open(path)) == meaning(Recording.open(newest))
