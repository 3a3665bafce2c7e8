"""How a run would have gone under other options, beside how it went."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.policy import EXACT
from neurosnap.agent.policy_kinds import new_policy
from neurosnap.apps.config.prepare import other_options
from neurosnap.apps.health_of_readings import health_of
from neurosnap.errors import RecordingError
from neurosnap.protocol.anomaly_report import NamedAnomaly, anomaly_line
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.compare_derived import Replay
from neurosnap.recording.replay.verify import departures
from neurosnap.runtime.anomaly_feed import recorded as fed
from tests.support.command_line import happy
from tests.support.deliberations import decided_by
from tests.support.home_runs import broken_home
from tests.support.inline_runs import resumed_run, spread
from tests.support.lamp import BIRTH, GROWN, LIMITED, lamp_options
from tests.support.recorded_runs import csv_run, path_run, planner_run, recorded
from tests.support.rewritten_recordings import rewritten
from tests.support.split_runs import TICKS, SplitRun

pytestmark = pytest.mark.slow

SET = ("--set", "anomalies.support=0", "--set", "health.alarms=never")
WATCHED = {"watch": True, "support": 1, "hold": 9}


def departed(log: Path, **given: object) -> list[dict[str, str]]:
    """Return what departs at each tick; in the keys, __ stands for a dot."""
    recording = Recording.open(log)
    keys = {key.replace("__", "."): value for key, value in given.items()}
    return list(departures(recording, other_options(recording.options, keys)))


def at(found: list[dict[str, str]], kind: str) -> dict[int, str]:
    return {tick: each[kind] for tick, each in enumerate(found, 1) if kind in each}


@pytest.fixture(scope="module")
def lamp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that grew a sensor, and was resumed while an anomaly was held on to."""
    folder = tmp_path_factory.mktemp("lamp")
    recorded(lamp_options(ticks=45, cells="inline", **WATCHED), folder / "a.mcap")
    resumed_run(folder / "a.mcap", folder / "b.mcap", 60)
    return folder / "b.mcap"


def test_of_the_same_options_nothing_departs(lamp: Path, tmp_path: Path) -> None:
    assert departed(lamp, anomalies__hold=9) == [{}] * 60
    limited = lamp_options(LIMITED, ticks=200, cells="inline")
    assert departed(recorded(limited, tmp_path / "limited.mcap")) == [{}] * 200
    numbers = "a,t\n" + "".join(f"{k % 2},{k * k % 17}\n" for k in range(60))
    (tmp_path / "t.csv").write_text(numbers, encoding="utf-8")
    cuts = tmp_path / "cuts.mcap"
    happy("run", tmp_path / "t.csv", "--cells=inline", "--out", cuts, *SET)
    assert departed(cuts) == [{}] * 60
    shared = msgspec.structs.replace(spread(csv_run(tmp_path / "a.csv")), **WATCHED)
    assert departed(recorded(shared, tmp_path / "spread.mcap")) == [{}] * 40


def test_it_departs_where_a_run_of_the_other_options_does(tmp_path: Path) -> None:
    """A table takes no actions: what is observed is the same."""
    options = msgspec.structs.replace(
        csv_run(tmp_path / "a.csv"), watch=True, support=1
    )
    changed = {"threshold": 0.2, "hold": 3, "support": 2}
    other = msgspec.structs.replace(options, **changed)
    was = recorded(options, tmp_path / "a.mcap")
    both = Recording.open(was), Recording.open(recorded(other, tmp_path / "b.mcap"))
    given = {"snapshot__threshold": 0.2, "anomalies__hold": 3, "anomalies__support": 2}
    found = departed(was, **given)
    states = [[m.literals for m in one.all("state", wire.State)] for one in both]
    apart = [tick for tick, (a, b) in enumerate(zip(*states, strict=True), 1) if a != b]
    assert [*at(found, "states")] == apart
    assert found[15]["states"] == "a unknown, c unknown (recorded a on, c off)"
    told, tells = (
        {m.tick: anomaly_line(m) for m in fed(one) if isinstance(m, NamedAnomaly)}
        for one in both
    )
    assert at(found, "anomalies") == {
        tick: f"{tells.get(tick, 'none')} (recorded {told.get(tick, 'none')})"
        for tick in range(1, 41)
        if tells.get(tick) != told.get(tick)
    }


def test_a_decision_is_what_would_have_been_decided_there(tmp_path: Path) -> None:
    log = recorded(planner_run(), tmp_path / "a.mcap")
    replay = Replay(Recording.open(log))
    body, seed, target = replay.options.body, replay.options.seed, ["x_below_2"]
    policy = new_policy("planner", body, seed, target=target, explore=0.4)
    expected: list[dict[str, str]] = []
    for tick in replay.ticks():
        would, _ = decided_by(
            replay.core.graph, policy, tick, replay.core.snapshot.state
        )
        both = [body.actions[each] for each in (would, replay.core.decision.action)]
        same = both[0] == both[1]
        expected.append({} if same else {"decisions": "{} (recorded {})".format(*both)})
    found = departed(log, agent__target=target, agent__explore=0.4)
    assert found == [*expected[:-1], {}]  # what was decided last is not recorded
    assert len(at(found, "decisions")) > 5


def test_auto_means_what_it_means_to_a_run() -> None:
    walks, plans = path_run(), planner_run()
    forgets = msgspec.structs.replace(plans, snapshot="discounted")
    for options, auto in ((walks, "auto"), (plans, EXACT), (forgets, "auto")):
        other = other_options(options, {"snapshot.threshold": "auto"})
        assert other.threshold == auto


def test_what_is_grown_otherwise_is_a_decision(lamp: Path) -> None:
    found = departed(lamp, snapshot__threshold=0.2)
    assert found[BIRTH - 1]["decisions"].endswith(f", grows {GROWN})")
    # The other grows it later. What only one has is in no state of both.
    decided, believed = (
        [tick for tick, words in at(found, kind).items() if GROWN in words]
        for kind in ("decisions", "states")
    )
    assert BIRTH == decided[0] < decided[1] < believed[0]
    assert "grown 1" not in str(at(found, "states"))


def test_an_alarm_is_raised_under_another_budget_only(tmp_path: Path) -> None:
    log = broken_home(tmp_path)
    week, day = (
        {each.line for each in health_of(Recording.open(log), budget).alarms}
        for budget in ("1/week", "1/day")
    )
    found = departed(log, health__alarms="1/day")
    assert {kind for each in found for kind in each} == {"alarms"}
    told = " ".join(each.get("alarms", "") for each in found)
    assert {line for line in week | day if line in told} == week ^ day
    assert day - week


def test_of_several_files_the_first_must_be_there(run: SplitRun) -> None:
    paths = run.write()
    assert departed(run.log) == [{}] * TICKS
    whole = departed(run.whole, snapshot__threshold=0.02)
    assert departed(run.log, snapshot__threshold=0.02) == whole != [{}] * TICKS
    with pytest.raises(
        RecordingError, match=r"must begin with the run, .*, got tick 10"
    ):
        departed(paths[1])


@pytest.mark.parametrize(
    ("lost", "ends"),
    [("Observation", 29), ("Decision", 30), ("Observation State Decision", 29)],
)
def test_it_ends_where_something_is_missing(
    lamp: Path, log: Path, lost: str, ends: int
) -> None:
    def change(recorded: list[Recorded]) -> Iterator[Recorded]:
        for each in recorded:
            message = each.message
            gone = type(message).__name__ in lost and getattr(message, "tick", 0) == 30
            if not gone:
                yield each

    assert departed(rewritten(lamp, log, change)) == [{}] * ends
