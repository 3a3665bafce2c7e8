"""Every kind of run gives its stored result, and so does its coordinator alone.

What is stored is replaced by ``python -m tests.golden.make``, where it is to change.
"""

import re
from pathlib import Path
from typing import NamedTuple

import pytest

from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.verify import verify
from tests.golden.drive import Driven, Step, drive
from tests.golden.make import FOLDER, stored
from tests.golden.meaning import lines, meaning_of, message_lines
from tests.golden.scenarios import SCENARIOS, Scenario, made

STORED = [each for each in SCENARIOS if each.stored]


class Made(NamedTuple):
    """A scenario, the lives of its swarm, and the recording."""

    scenario: Scenario
    lives: list[Driven]
    log: Path


@pytest.fixture(scope="module", params=SCENARIOS, ids=lambda each: each.name)
def run(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Made:
    scenario = request.param
    log = tmp_path_factory.mktemp("golden") / f"{scenario.name}.mcap"
    return Made(scenario, made(scenario, log), log)


def test_it_means_what_it_meant(run: Made) -> None:
    expected = meant(run.scenario)
    for now, before in zip(meaning_of(run.scenario, run.lives), expected, strict=True):
        assert now == before


def test_the_coordinator_says_what_it_said(run: Made) -> None:
    path = stored("messages", run.scenario.name)
    said, expected = message_lines(run.lives), path.read_text("utf-8").splitlines()
    for (line, steps), before in zip(said.items(), expected, strict=True):
        assert line == before, f"was {before}, is {line}:\n{readable(steps)}"


def test_its_recording_is_whole_and_verifies(run: Made) -> None:
    verdict = verify(run.log)
    assert (verdict.difference, verdict.complete) == (None, True)
    assert verdict.ticks == run.scenario.options.ticks


def test_its_recording_means_what_it_did(run: Made) -> None:
    if not run.scenario.dies:
        expected = meant(run.scenario)[:-1]
    else:  # as if nothing had happened
        options, order = run.scenario.options, run.scenario.order
        whole = drive(options, run.scenario.new_source(), order)
        expected = lines(whole.seen_by_coordinator(), len(options.sensors))
    found = recorded(run.log, run.scenario)
    assert without_key_frames(found) == without_key_frames(expected)


def test_a_split_run_has_several_files(run: Made) -> None:
    assert (len(part_paths(run.log)) > 1) == (run.scenario.split > 0)


def test_there_is_a_scenario_for_all_that_may_happen() -> None:
    texts = {each.name: "\n".join(meant(each)) for each in SCENARIOS}
    assert "; retires" in texts["growing-resumed"]
    assert texts["retiring"].count("; retires") == 2
    assert "begins cut" in texts["growing-cut-off"]
    assert "; born" in texts["growing"]
    assert "anomaly since 50" in texts["anomalies"]
    assert "incoherent" in texts["anomalies"]


@pytest.mark.parametrize("scenario", STORED, ids=lambda each: each.name)
def test_a_stored_recording_can_be_read(scenario: Scenario) -> None:
    log = FOLDER / "runs" / f"{scenario.name}.mcap"
    verdict = verify(log)
    assert (verdict.difference, verdict.complete) == (None, True)
    if not scenario.dies:
        assert recorded(log, scenario) == meant(scenario)[:-1]


def meant(scenario: Scenario) -> list[str]:
    path = stored("meanings", scenario.like or scenario.name)
    return path.read_text("utf-8").splitlines()


def recorded(log: Path, scenario: Scenario) -> list[str]:
    """Return what a recording says that a run came to."""
    messages = (each.message for each in Recording.open(log).messages())
    return lines(messages, len(scenario.options.sensors))


def without_key_frames(found: list[str]) -> list[str]:
    """Return what is said of a run, which has one more where it is resumed."""
    return [re.sub(r"key-frame \d+(; )?", "", line) for line in found]


def readable(steps: list[Step]) -> str:
    texts = []
    for step in steps:
        texts.append(f"{step.received}:")
        texts += [f"    {message!r:.300}" for message in step.published]
    return "\n".join(texts)
