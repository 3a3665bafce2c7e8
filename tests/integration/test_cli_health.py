"""Tests of ``neurosnap health`` from the command line."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from neurosnap import wire
from neurosnap.apps.viewer.background_reading import RunHistory
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.parts import health_listener
from neurosnap.runtime.parts.health_listener import HealthListener, Past
from tests.support.command_line import call, happy
from tests.support.patience import PATIENCE

if TYPE_CHECKING:
    from neurosnap.health.alarm import Standing

DATABASE = Path(__file__).parent.parent / "golden" / "home-assistant_v2.db"
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def table(home_log: Path) -> Path:
    """Return a home whose flush rests from a day on, a row for each change."""
    return home_log.with_name("home.csv")


def test_a_broken_sensor_is_named_in_a_line_and_as_json(table: Path) -> None:
    result = call("health", table)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert any(
        " flush: silent since " in line and "(bath came on" in line for line in lines
    )
    assert lines[-2].startswith("learning: ")
    assert lines[-2].endswith(" 8 of 8 sensors known")
    assert lines[-1].endswith("in force (budget 1/week)")
    facts = happy("health", table, "--alarms", "1/month")
    health = {each["sensor"]: each["health"] for each in facts["sensors"]}
    assert health["flush"] == 0
    last = [each for each in facts["alarms"] if each["alarm"]["sensor"] == "flush"][-1]
    assert (last["alarm"]["kind"], last["ended"]) == ("silent", None)
    assert facts["budget"] == "1/month"


def test_a_window_that_opens_again_and_again_is_not_silent_in_between() -> None:
    """Nothing was expected of it meanwhile, however short its silences are mostly."""
    assert happy("health", DATABASE)["alarms"] == []


@pytest.fixture(scope="module")
def facts(home_log: Path) -> dict[str, Any]:
    """Return what is said of the recording's sensors."""
    return happy("health", home_log)


@pytest.mark.exhaustive
def test_a_recording_says_what_its_readings_said(
    table: Path, facts: dict[str, Any]
) -> None:
    assert facts == happy("health", table)
    assert ("flush", "silent") in [
        (each["alarm"]["sensor"], each["alarm"]["kind"]) for each in facts["alarms"]
    ]


def test_a_recording_is_watched_with_its_alarms_and_their_ends(
    home_log: Path, facts: dict[str, Any]
) -> None:
    alarms = facts["alarms"]
    lines = call("watch", home_log).stdout.splitlines()
    for each in alarms:
        assert [line for line in lines if line.endswith(f"UTC  {each['line']}")]
    well = [line for line in lines if line.endswith(": alarm over")]
    assert len(well) == sum(
        each["ended"] is not None and each["became"] is None for each in alarms
    )


def test_the_page_shows_what_is_said(home_log: Path, facts: dict[str, Any]) -> None:
    end = RunView(home_log).last
    view = RunHistory(RunView(home_log))
    assert not view.findings().done
    while view.read_on():
        assert view.findings().done == (view.findings().read_to == end)
    shown = view.findings()
    assert shown.progress.endswith(" 8 of 8 sensors known")
    for told, each in zip(shown.findings, reversed(facts["alarms"]), strict=True):
        assert told.sentence == each["line"]
        assert (told.state == "now") == (each["ended"] is None) == (told.lasted == "")
        # The evidence begins in a step; the first reading in it or after it is shown.
        since = told.began.rpartition(":")[0]
        assert since[:-1] in each["line"] or told.first < told.tick


@pytest.mark.exhaustive
async def test_one_who_catches_up_knows_what_it_knew(
    home_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(health_listener, "_LAST", PATIENCE)
    recording = Recording.open(home_log)
    told = [
        (each.message, each.sent)
        for each in recording.messages(("observation",))
        if isinstance(each.message, wire.Observation)
    ]
    middle = len(told) - 40
    over = asyncio.Event()
    over.set()
    heard: dict[int, list[Standing]] = {0: [], middle: []}
    for start, standings in heard.items():
        past = Past(home_log, start) if start else None
        listener = HealthListener(recording.options, standings.append, past)
        for message, sent in told[start:]:
            listener.receive(message, sent)
        await listener.serve(over)
    again = heard[middle]
    assert again[-1].alarms
    assert again == heard[0][-len(again) :]
