"""What the page receives about grown sensors, planning waves and plans."""

import asyncio
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.agent.plan import Names, Plan, plan_told
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.background_reading import RunHistory
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.waves import first_shown, plan_of
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run_with_restarts import run
from neurosnap.sensorium import Sensorium
from tests.support.lamp import BIRTH, GROWN, lamp_options

TICKS, SENSORS = 120, 24
LEARNED = 60  # ticks after which every outcome in the lamp's world is guaranteed
HERE = np.zeros(2, np.bool_)
ACTIONS = ("down", "right", "in 3", "up")
NAMES = Names(ACTIONS, Sensorium(["door"]))


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> RunView:
    path = tmp_path_factory.mktemp("lamp") / "lamp.mcap"
    options = lamp_options(ticks=TICKS, cells="inline")
    asyncio.run(run(RunRequest(options, path), asyncio.Event()))
    return RunView(path)


def test_a_sensor_is_there_from_its_birth_on(view: RunView) -> None:
    frames = view.frames(1, TICKS)
    assert {frame.sensors for frame in frames[: BIRTH - 1]} == {SENSORS}
    assert {frame.sensors for frame in frames[BIRTH - 1 :]} == {SENSORS + 1}
    told = [(c.tick, c.sensor, c.name) for frame in frames for c in frame.changed]
    assert told == [(BIRTH, SENSORS, GROWN)]
    assert len(view.graph(BIRTH - 1).nodes) == SENSORS
    assert view.graph(BIRTH).nodes[-1].name == GROWN
    assert frames[BIRTH - 2].graph != frames[BIRTH - 1].graph
    assert view.graph(BIRTH).id == frames[BIRTH - 1].graph


def test_births_are_known_once_the_recording_is_read(view: RunView) -> None:
    history = RunHistory(RunView(view.path))
    assert not history.grown().done
    while history.read_on():
        pass
    grown = history.grown()
    assert [(each.tick, each.name) for each in grown.births] == [(BIRTH, GROWN)]
    assert (grown.room, grown.read_to, grown.done) == (2, TICKS, True)


def test_a_wave_says_its_action_and_whether_its_state_was_imagined(
    view: RunView,
) -> None:
    body = view.options.body
    own, first = len(body.own), len(body.own) + len(body.actions)
    ahead = 0
    for frame in view.frames(LEARNED, TICKS):
        for wave in frame.waves:
            if wave.kind == "state":
                assert (wave.action, wave.imagined) == (None, False)
                continue
            assert wave.action is not None
            assert wave.signal[0] == 2 * (own + wave.action)
            held = [
                body.context[(literal >> 1) - first][1]
                for literal in wave.signal[1:]
                if (literal >> 1) - first < len(body.context)
            ]
            here = [2 * k + (not bit) for k, bit in enumerate(frame.state[:own])]
            assert wave.imagined == (held != here) == (wave.hops is None)
            ahead += wave.imagined
    assert ahead > 10


def test_a_frame_has_the_oldest_of_the_imagined_waves() -> None:
    def wave(number: int) -> api.WaveView:
        asked: dict[str, Any] = {"signal": [0], "depth": 1, "pulses": 99}
        return api.WaveView(
            wave=number,
            kind="signal",
            hops=None if number > 3 else [(0, 1)],
            settled=True,
            imagined=number > 3,
            **asked,
        )

    waves = [wave(number) for number in range(1, 1000)]
    shown = first_shown(waves)
    assert [wave.wave for wave in shown] == list(range(1, api.MOST_IMAGINED + 4))
    assert shown[:3] == waves[:3]
    assert first_shown(waves[:3]) == waves[:3]


def test_a_plan_begins_with_the_decision_and_says_how_far_it_is(view: RunView) -> None:
    longest = 0
    for frame in view.frames(1, TICKS):
        if frame.plan is None:
            assert ", in " not in frame.why
            continue
        assert (frame.plan.steps[0], frame.plan.more) == (frame.choice, 0)
        assert f"in {len(frame.plan.steps)}: " in frame.why
        longest = max(longest, len(frame.plan.steps))
    assert longest >= 3


@given(
    st.lists(st.sampled_from(range(4)), min_size=1, max_size=9),
    st.sampled_from(["", "to learn what down does there, ", "in 2: up, "]),
)
def test_a_reason_tells_its_plan(steps: list[int], why: str) -> None:
    plan = Plan(tuple(steps), np.zeros((len(steps), 2), np.bool_), why)
    told = plan_told(plan.reason(HERE, NAMES), ACTIONS)
    assert told == (len(steps), tuple(steps[:6]), why.removesuffix(", "))


@pytest.mark.parametrize(
    "why",
    [
        *("", "at random", "in 0: ", "in 2: down", "in 1: down, right", "in 1: left"),
        *("in 7: down, up, up, up, up, up", "in 1: down, …", "thin 1: down"),
    ],
)
def test_what_tells_of_no_plan_is_none(why: str) -> None:
    assert plan_told(why, ACTIONS) is None


def test_a_plan_counts_the_steps_it_does_not_name() -> None:
    steps = (0, 1, 1, 0, 3, 0, 1, 3)
    why = Plan(steps, np.zeros((8, 2), np.bool_), "").reason(HERE, NAMES)
    plan = plan_of(wire.Decision(4, steps[0], why), ACTIONS, ("door", "dark"))
    told = api.PlanView(steps=list(steps[:6]), more=2, why="to achieve door, dark")
    assert plan == told
    assert plan_of(None, ACTIONS, ()) is None
    assert plan_of(wire.Decision(4, 3, why), ACTIONS, ()) is None  # another was taken
