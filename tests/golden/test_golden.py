"""Recordings made once stay readable, and mean what they meant."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from neurosnap import wire
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.replay.verify import verify
from tests.golden.make import FOLDER, MESSAGES, make, meaning

RECORDINGS = sorted(FOLDER.glob("recording-*.mcap"))
RUNS = sorted(FOLDER.glob("run-*.mcap"))
GROWING = FOLDER / "run-3-growing.mcap"


def test_every_schema_has_its_recording() -> None:
    names = {path.stem for path in RECORDINGS}
    assert names == {f"recording-{number + 1}" for number in range(wire.SCHEMA)}


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda path: path.stem)
def test_it_means_what_it_meant(path: Path) -> None:
    meant = msgspec.json.decode(path.with_suffix(".json").read_bytes())
    for recorded in meant["messages"]:  # what it lacks means what it meant before
        message = msgspec.convert(recorded["message"], wire.Message)
        recorded["message"] = msgspec.json.decode(wire.encode(message))
    balance = msgspec.convert(meant["completeness"], Completeness)
    meant["completeness"] = msgspec.json.decode(msgspec.json.encode(balance))
    means = msgspec.json.encode(meaning(Recording.open(path)))
    assert msgspec.json.decode(means) == meant


def test_it_holds_every_kind_of_message() -> None:
    topics = {wire.topic(message.key) for _, message in MESSAGES}
    assert topics == set(wire.TOPICS)


@pytest.mark.parametrize("path", RUNS, ids=lambda path: path.stem)
def test_a_run_of_an_older_schema_is_derived_again(path: Path) -> None:
    verdict = verify(path)
    ticks = 30 if path == GROWING else 12
    assert (verdict.difference, verdict.complete) == (None, True)
    assert (verdict.ticks, verdict.decisions) == (ticks, ticks)


def test_a_run_that_grew_a_sensor_is_among_them() -> None:
    births = [
        recorded.message
        for recorded in Recording.open(GROWING).messages(("decide",))
        if isinstance(recorded.message, wire.Decision) and recorded.message.born >= 0
    ]
    assert [(one.tick, one.literals) for one in births] == [(22, (0, 2))]


def test_what_is_written_today_means_the_same(tmp_path: Path) -> None:
    newest = FOLDER / f"recording-{wire.SCHEMA}.mcap"
    path = make(tmp_path)
    assert filled(path) == filled(newest)


def filled(path: Path) -> dict[str, Any]:
    """Return what is in a recording, with the defaults of what it lacks."""
    means = meaning(Recording.open(path))
    balance = msgspec.json.decode(means["totals"]["completeness"], type=Completeness)
    return {**means, "totals": {**means["totals"], "completeness": balance}}
