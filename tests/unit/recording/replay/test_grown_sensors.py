"""The sensors a run has grown, read from its decisions and key-frames."""

import random
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.memory import AgentMemory
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import SMALLEST, CellKind, RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.replay.grown_sensors import Births, RecordedBirth, births_of
from neurosnap.recording.replay.verify import verify
from tests.golden.drive import drive, record
from tests.support.course import course
from tests.support.inline_runs import record_scripted, recorded_run
from tests.support.lamp import BIRTH, GROWN, lamp_options
from tests.support.rewritten_recordings import changing, rewritten
from tests.support.scripted_sources import Scripted

BODY = Body.full(["door", "dark"], ["push"], room=3)
FIRST = BODY.size
ONE, TWO = (0, 2), (1, 3)  # push where door and dark hold; where neither does


def birth(tick: int, literals: tuple[int, ...], sensor: int) -> wire.Decision:
    return wire.Decision(tick, 0, "", born=sensor, literals=literals, history=tick)


def frame(tick: int, body: Body) -> wire.KeyFrame:
    memory = AgentMemory(BODY)
    memory.body = body
    return wire.KeyFrame(tick, b"", waves=1, agent=memory.to_bytes())


def shown(births: Births) -> list[tuple[object, ...]]:
    return [msgspec.structs.astuple(each) for each in births.listed]


def test_each_birth_is_listed_with_its_tick_and_history() -> None:
    births = Births(BODY)
    for message in (
        wire.Decision(0, -1, "the run begins"),
        birth(4, ONE, FIRST),
        wire.Decision(5, 0, ""),
        birth(6, TWO, FIRST + 1),
        wire.Decision(8, 0, "", retires=FIRST),
    ):
        births.follow(message)
    assert shown(births) == [
        (4, FIRST, "push&door&dark", 4, True, 8, ""),
        (6, FIRST + 1, "push&~door&~dark", 6, True, None, ""),
    ]
    assert births.names[FIRST:] == ("push&door&dark", "push&~door&~dark")
    assert births.room == 1
    assert births.at(3) == ()
    assert [each.retired for each in births.at(7)] == [None, None]
    assert births.read_at(5) == [*range(FIRST), FIRST]
    assert births.read_at(8) == [*range(FIRST), FIRST + 1]


def test_the_last_tick_of_a_run_is_known_from_its_key_frame() -> None:
    births = Births(BODY)
    births.follow(wire.Decision(1, 0, ""))
    births.follow(frame(2, BODY.grow(Context(0, ONE))))
    assert shown(births) == [(2, FIRST, "push&door&dark", None, True, None, "")]


def test_behind_a_gap_it_goes_on_from_the_next_key_frame() -> None:
    grown = BODY.grow(Context(0, ONE)).grow(Context(0, TWO))
    births = Births(BODY)
    births.follow(wire.Decision(1, 0, ""))
    births.follow(birth(9, TWO, FIRST + 1))  # what was grown before it is missing
    assert births.listed == ()
    births.follow(frame(12, grown.retire(0)))
    births.follow(wire.Decision(12, 0, "said again"))
    births.follow(birth(14, (0, 3), FIRST + 2))
    assert shown(births) == [
        (12, FIRST, "push&door&dark", None, False, 12, ""),
        (12, FIRST + 1, "push&~door&~dark", None, False, None, ""),
        (14, FIRST + 2, "push&door&~dark", 14, True, None, ""),
    ]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lamp") / "lamp.mcap"
    recorded_run(lamp_options(cells="inline", ticks=40), path)
    return path


def test_info_lists_what_a_run_has_grown(log: Path) -> None:
    found = describe(Recording.open(log))
    only = RecordedBirth(tick=BIRTH, sensor=24, name=GROWN, history=BIRTH)
    assert (found.births, found.room) == ((only,), 2)
    text = "\n".join(render(found))
    assert "grown: 1, room for 2 more\n" in text
    assert f"  tick {BIRTH}  sensor 24  {GROWN}  from {BIRTH} ticks\n" in text


@pytest.mark.slow
def test_a_later_file_alone_says_by_when(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    # Enough for several chunks: only they count towards the size of a file.
    recorded_run(lamp_options(cells="inline", ticks=400, split=SMALLEST), log)
    (found,) = births_of(Recording.open(log)).listed
    assert (found.tick, found.exact) == (BIRTH, True)
    last = max(tmp_path.glob("log_*.mcap"))
    (later,) = births_of(Recording.open(last)).listed
    assert later.tick == Recording.open(last).begins
    assert (later.name, later.exact) == (GROWN, False)


def test_a_key_frame_that_holds_no_agent_is_named(log: Path, tmp_path: Path) -> None:
    change = changing(wire.KeyFrame, lambda _: True, lambda _: {"agent": b"nothing"})
    wrong = rewritten(log, tmp_path / "wrong.mcap", change)
    with pytest.raises(RecordingError, match="key-frame of tick 10: must hold an agen"):
        births_of(Recording.open(wrong))


@pytest.mark.slow
@pytest.mark.parametrize("cells", ["process", "worker"])
@pytest.mark.parametrize("until", [126, 128, 129])
def test_windows_grow_in_a_swarm_that_is_killed_as_in_one_that_is_not(
    cells: CellKind, until: int, tmp_path: Path
) -> None:
    chance = random.Random(1)
    rows = [[chance.random() < 0.6 for _ in range(2)] for _ in range(140)]
    for before, row in pairwise([[False], *rows]):
        row += [row[0] and row[1], row[0] and before[0]]
    options = RunOptions(
        source="scripted",
        body=Body(own=("s0", "s1", "s2", "s3"), room=3),
        ticks=140,
        threshold=0.01,
        cells=cells,
        workers=2,
        keyframe_every=16,
    )
    whole, killed, log = (tmp_path / f"{k}.mcap" for k in range(3))
    record_scripted(Scripted(rows), options, whole)
    grown = [each.name for each in births_of(Recording.open(whole)).listed]
    assert grown == ["s0 for 1 tick", "s0&s1"]
    record(drive(options, Scripted(rows), until=until), options, killed)
    _, past = find_resume_point(killed, until)
    assert past.tick == until
    record_scripted(Scripted(rows), options, log, past)
    assert course(log) == course(whole)
    verdict = verify(log)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, True, 140)
