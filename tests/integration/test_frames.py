"""Images in a recording are complete and readable, and do not affect the run."""

import base64
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray
from PIL import Image

from neurosnap import wire
from neurosnap.agent.environment import Continuing
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording, part_paths
from tests.support.course import course
from tests.support.foxglove_rules import refusals
from tests.support.inline_runs import recorded_run, resumed_run
from tests.support.recorded_messages import assert_true_run, of_type
from tests.support.run_options import options_for

LAKE = "neurosnap/FrozenLake-v0"
TICKS = 20
EVERY = 3
SEED = 5


def lake_run(frames: int = EVERY, **more: object) -> RunOptions:
    given = {"ticks": TICKS, "cells": "inline", "frames": frames, **more}
    return options_for(LAKE, SEED, **given)  # type: ignore[arg-type]


def images(log: Path) -> dict[int, wire.Image]:
    found = [
        each.message
        for each in Recording.open_file(log).messages(("image",))
        if isinstance(each.message, wire.Image)
    ]
    by_tick = {image.tick: image for image in found}
    assert len(by_tick) == len(found)
    return by_tick


def pixels(data: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(data)))


def drawn(log: Path) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield each tick and what the lake draws there, the same actions taken."""
    decisions = {each.tick: each for each in of_type(log, wire.Decision)}
    env: Any = Continuing(gymnasium.make(LAKE, render_mode="rgb_array"))
    env.reset(seed=SEED)
    for tick in range(1, len(decisions)):
        yield tick, env.render()
        env.step(decisions[tick].action)
    env.close()


def assert_all_there(log: Path, ticks: int = TICKS, every: int = EVERY) -> None:
    found = images(log)
    assert sorted(found) == list(range(1, ticks + 1, every))
    for tick, shown in drawn(log):
        if tick in found:
            np.testing.assert_array_equal(pixels(found[tick].data), shown)
    assert_true_run(log, ticks=ticks)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("frames") / "run.mcap"
    recorded_run(lake_run(), path)
    return path


def test_there_is_one_each_so_many_ticks_and_it_is_what_was_there(log: Path) -> None:
    assert_all_there(log)
    recording = Recording.open(log)
    assert recording.balance(recording.sequences()).whole


def test_other_programs_read_it_as_their_own(log: Path) -> None:
    """By the library of MCAP alone, as Foxglove and Lichtblick would."""
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        (channel,) = [c for c in summary.channels.values() if c.topic == "/image"]
        schema = summary.schemas[channel.schema_id]
        assert channel.message_encoding == "json"
        assert (schema.name, schema.encoding) == (
            "foxglove.CompressedImage",
            "jsonschema",
        )
        told = json.loads(schema.data)
        assert refusals(told) == []
        theirs = {"timestamp", "frame_id", "data", "format"}
        assert theirs <= set(told["required"])
        count = 0
        shown = dict(drawn(log))
        for _, _, message in make_reader(file).iter_messages(topics=["/image"]):
            image = json.loads(message.data)
            assert image["format"] == "png"
            assert image["frame_id"] == "world"
            seen = pixels(base64.b64decode(image["data"], validate=True))
            np.testing.assert_array_equal(seen, shown[image["tick"]])
            stamp = image["timestamp"]
            nanoseconds = stamp["sec"] * 10**9 + stamp["nsec"]
            # It was drawn before it was sent, and that by less than a minute.
            assert 0 <= message.publish_time - nanoseconds < 60 * 10**9
            count += 1
        assert count == 7


def test_all_else_is_the_same_without(log: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain.mcap"
    recorded_run(lake_run(frames=0), plain)
    assert images(plain) == {}

    def told(path: Path) -> list[bytes]:
        return sorted(
            each.payload
            for each in Recording.open(path).messages()
            if not isinstance(each.message, wire.Image)
        )

    assert told(plain) == told(log)


def test_a_run_that_goes_on_has_all_of_them(log: Path, tmp_path: Path) -> None:
    start, on = tmp_path / "start.mcap", tmp_path / "on.mcap"
    recorded_run(lake_run(ticks=11), start)
    resumed_run(start, on, TICKS)
    assert_all_there(on)
    assert course(on) == course(log)


@pytest.mark.slow
@pytest.mark.usefixtures("many_files")
def test_a_run_in_several_files_has_all_of_them(tmp_path: Path) -> None:
    path, ticks = tmp_path / "run.mcap", 40
    recorded_run(lake_run(frames=2, ticks=ticks, keyframe_every=10), path)
    paths = part_paths(path).values()
    assert len(paths) > 1
    found = [tick for each in paths for tick in sorted(images(each))]
    assert found == list(range(1, ticks + 1, 2))
    assert_true_run(path, ticks=ticks)


@pytest.mark.slow
def test_in_processes_it_is_the_same(log: Path, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorded_run(lake_run(cells="worker", workers=2), path)
    assert_all_there(path)
    assert course(path) == course(log)
    here, there = images(log), images(path)
    assert {tick: one.data for tick, one in here.items()} == {
        tick: one.data for tick, one in there.items()
    }
