"""Services go on with a run that was stopped, and with nothing else."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.verify import verify
from tests.support.course import course
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.services import (
    CELLS,
    ENDLESS,
    PATH,
    SMALL,
    SWARM,
    ended,
    facts,
    going,
    hub_at,
    in_one_piece,
    placed,
    stopped_at,
    up,
)

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A hub on loopback."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


def test_services_go_on_with_a_run_that_was_stopped(
    endpoint: str, tmp_path: Path
) -> None:
    log, new = tmp_path / "log.mcap", tmp_path / "new.mcap"
    tick = stopped_at(endpoint, log)
    content, at = log.read_bytes(), ("--connect", endpoint)
    lines: tuple[tuple[object, ...], ...] = (
        ("serve", "recorder", SWARM, "--out", new, "--resume", log, "--format", "json"),
        ("serve", "cells", SWARM, "0-5"),
        ("serve", "world", SWARM, PATH),
    )
    again = (
        "serve",
        "coordinator",
        PATH,
        "--swarm",
        SWARM,
        *SMALL,
        "--ticks",
        tick + 20,
    )
    with ExitStack() as stack:
        others = [stack.enter_context(going(*line, *at)) for line in lines]
        with going(*again, "--resume", log, "--format", "json", *at) as coordinator:
            came = facts(ended(coordinator))
        recorder, *_ = [ended(one) for one in others]
    assert (came["ticks"], came["resumed_at"]) == (tick + 20, tick)
    assert facts(recorder)["complete"]
    assert log.read_bytes() == content
    cells = [f"cell/{number}" for number in range(CELLS)]
    assert placed(new) == placed(log) == {"coordinator", "world", *cells}
    assert Recording.open(new).files[-1].places != Recording.open(log).files[-1].places
    verdict = verify(new)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, tick + 20)
    assert course(new) == course(in_one_piece(tick + 20, tmp_path / "inline"))


SPLIT = """
[source]
kind = "world"
id = "neurosnap/Path-v0"
arguments = { places = 7 }

[recording]
keyframe_every = 50
split = 65536
"""


def test_a_recorder_names_the_file_in_which_a_split_run_goes_on(
    endpoint: str, tmp_path: Path
) -> None:
    described, log, new = (tmp_path / name for name in ("s.toml", "a.mcap", "b.mcap"))
    described.write_text(SPLIT)
    # The second file begins with tick 250 at the latest.
    tick = stopped_at(endpoint, log, (described, "--ticks", 1_000_000), 350)
    at, again = ("--connect", endpoint), ("--resume", log)
    lines: tuple[tuple[object, ...], ...] = (
        ("serve", "recorder", SWARM, "--out", new, *again, "--format", "json"),
        ("serve", "cells", SWARM, "0-5"),
        ("serve", "world", SWARM, PATH),
        (
            "serve",
            "coordinator",
            described,
            "--swarm",
            SWARM,
            "--ticks",
            tick + 5,
            *again,
        ),
    )
    with ExitStack() as stack:
        going_on = [stack.enter_context(going(*line, *at)) for line in lines]
        recorder, *_ = [ended(one) for one in going_on]
    written = log.with_name(f"b_{len(part_paths(log)) - 1:04d}.mcap")
    assert len(part_paths(log)) > 1
    assert facts(recorder)["logs"] == [str(written)]
    verdict = verify(written)
    assert (verdict.same, verdict.complete) == (True, True)


def test_only_the_same_run_goes_on_and_if_there_is_more_to_come(
    endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    tick = stopped_at(endpoint, log)
    whole = ("serve", "coordinator", PATH, "--swarm", SWARM, "--connect", endpoint)
    ways: tuple[tuple[tuple[object, ...], str], ...] = (
        (("--set", "places=7", "--seed", 4), "resume: must be a recording of the run"),
        ((*SMALL, "--ticks", tick), f"ticks: must be more than the {tick} there are"),
    )
    for described, text in ways:
        with going(*whole, *described, "--resume", log) as coordinator:
            assert text in ended(coordinator, 2)


@pytest.mark.parametrize("new", [True, False], ids=["new run", "another recording"])
def test_a_recorder_takes_over_nothing_but_what_the_run_goes_on_from(
    new: bool, endpoint: str, tmp_path: Path
) -> None:
    log, at = tmp_path / "log.mcap", ("--connect", endpoint)
    stopped_at(endpoint, log)
    other = in_one_piece(40, tmp_path / "other.mcap")
    whole = ("serve", "coordinator", PATH, "--swarm", SWARM, *ENDLESS, *at)
    more: tuple[object, ...] = () if new else ("--resume", log)
    rule = "go with a resumed run" if new else "be the recording that the"
    with going(*whole, *more) as coordinator:
        up(endpoint, "coordinator")
        line = (
            "serve",
            "recorder",
            SWARM,
            "--out",
            tmp_path / "new",
            "--resume",
            other,
            *at,
        )
        with going(*line) as recorder:
            assert f"resume: must {rule}" in ended(recorder, 2)
        coordinator.send_signal(signal.SIGINT)
        coordinator.communicate(timeout=PATIENCE)
    assert not (tmp_path / "new").exists()
