"""Signals are cut where they say something, and what is known of cuts always holds."""

import random
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps import library
from neurosnap.apps.export.relations import learned_from
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.pair_occasions import count_pairs
from neurosnap.poc.learning.relation_rule import judge
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.learn_again import Learning
from neurosnap.sources.conditions import Choice, Comparison, Condition
from neurosnap.sources.conditions import parse_condition as parsed
from neurosnap.sources.cuts import as_json, known_order, recorded_signals, with_cuts
from neurosnap.sources.live.journal import JournalRow
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.signal_readers import SignalReaders
from neurosnap.sources.live.tick_schedule import Clocked
from neurosnap.sources.meaning import Reader, compared, numbers_in
from neurosnap.sources.open import open_source, settle
from neurosnap.sources.open_readings import open_readings
from neurosnap.sources.wanted import Wanted
from tests.support.command_line import call
from tests.support.edges import edge_matrix

NUMBERS = st.integers(0, 3).map(float)


def cut(*texts: str, learned: int | None = None, bins: int = 4) -> list[str] | None:
    """Return the names of the sensors a signal is cut into; None if it is none."""
    upto = len(texts) if learned is None else learned
    said = (("x", text, number < upto) for number, text in enumerate(texts))
    chosen = with_cuts(Wanted(bins=bins), said).cuts
    assert chosen is not None
    return [each.name for each in chosen["x"] if each] if "x" in chosen else None


def known(conditions: Iterable[Condition]) -> Iterator[tuple[int, int]]:
    """Return what is known of the sensors with these conditions, in their order."""
    named = {each.name: each for each in conditions}
    return known_order([*named], named)


@pytest.mark.parametrize(
    ("texts", "names"),
    [
        (("0", "1", "", "1.0"), None),
        (("on", "off", "unknown"), None),
        (("on", "off", "ajar"), None),  # it is refused where it is read
        (("0", "1", "ajar"), None),
        (tuple("abcdefghi"), None),
        (("0", "1", "2", "nan"), ["x>0", "x>1"]),
        (("7", "7"), []),
        (("warm",), []),
        (("Warm", "cold", "hot", "warm"), ["x=cold", "x=hot", "x=warm"]),
        (tuple(map(str, range(100, -1, -1))), ["x>25", "x>50", "x>75"]),
        (tuple(map(str, range(101))), []),
        (("20.001", "20.002"), ["x>20.001"]),
        (("-1e300", "1e300", "inf"), ["x>-1e+300"]),
    ],
)
def test_each_signal_is_cut_by_what_it_says(
    texts: tuple[str, ...], names: list[str] | None
) -> None:
    assert cut(*texts) == names


def test_what_is_of_a_type_of_fractions_is_no_bit() -> None:
    values = [1.0, 0.0, 1.0, None, float("nan")]
    chosen = with_cuts(Wanted(), [("x", each, True) for each in values]).cuts
    assert chosen == {"x": (parsed("x > 0"),)}
    assert with_cuts(Wanted(), [("x", each, True) for each in (1, 0, True)]).cuts == {}


def test_cuts_are_chosen_by_what_is_learned_and_kinds_by_all() -> None:
    texts = [*map(str, range(9)), *["1000"] * 90]
    assert cut(*texts, learned=9, bins=2) == ["x>4"]
    assert cut("0", "1", "2.5", learned=2) == ["x>0"]
    assert cut("", "2.5", learned=1) == []


def test_a_long_signal_is_cut_like_a_short_one() -> None:
    texts = map(str, range(100_003, 0, -1))
    limits = [float(name[2:]) for name in cut(*texts) or ()]
    assert limits == pytest.approx([25_000, 50_000, 75_000], rel=0.01)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2), st.integers(2, 9))
def test_every_part_has_its_share_of_the_values(values: list[float], bins: int) -> None:
    names = cut(*map(repr, values), bins=bins)
    if names is None:
        assert {*values} <= {0, 1}
        return
    limits = [parsed(name).limit for name in names]  # type: ignore[union-attr]
    assert limits == sorted(set(limits))
    parts = [
        sum(low < value <= high for value in values)
        for low, high in pairwise([-float("inf"), *limits, float("inf")])
    ]
    assert min(parts) > 0 or len({*values}) == 1
    assert len(parts) <= bins
    if len({*values}) <= bins:
        assert len(parts) == len({*values})


@st.composite
def comparisons(draw: st.DrawFn) -> Comparison:
    above, limit = draw(st.booleans()), draw(NUMBERS)
    back = draw(st.none() | st.just(1.5))
    release = None if back is None else limit - back if above else limit + back
    return Comparison("x", above, limit, release)


@given(
    st.lists(comparisons(), min_size=2, max_size=4),
    st.lists(st.integers(-3, 9).map(lambda number: number / 2), min_size=2),
)
def test_what_is_known_of_cuts_is_never_broken(
    cuts: list[Comparison], values: list[float]
) -> None:
    readers = [Reader(f"s{n}", each) for n, each in enumerate(cuts)]
    wanted = Wanted(conditions=tuple({each.name: each for each in cuts}.values()))
    order = [*known(wanted.conditions)]
    readers = [Reader(each.name, each) for each in wanted.conditions]
    for value in values:
        read = [reader.read(value) for reader in readers]
        literals = [on == (not star) for on in read for star in (0, 1)]
        for a, b in order:
            if None not in (read[a >> 1], read[b >> 1]):
                assert literals[b] or not literals[a]
        assert {(b ^ 1, a ^ 1) for a, b in order} == {*order}


@given(st.lists(st.sampled_from((1, 2, 3, None)), min_size=3, max_size=8))
def test_what_is_known_of_changes_is_never_broken(values: list[int | None]) -> None:
    events = [*map(parsed, ("x rises", "x falls", "x changes"))]
    order = [*known(events)]
    assert {(0, 4), (2, 4), (0, 3)} < {*order}
    readers = [Reader(each.name, each) for each in events]
    before: int | None = None
    for value in values:
        read = [reader.read(value) for reader in readers]
        if value is None or before is None:
            assert read == [None] * 3
        else:
            assert read == [value > before, value < before, value != before]
            literals = [on == (not star) for on in read for star in (0, 1)]
            assert all(literals[b] or not literals[a] for a, b in order)
        before = value


def test_what_was_heard_lately_was_heard() -> None:
    heard = tuple(parsed(f"/a heard within {span}") for span in ("2 s", "500 ms"))
    assert [each.name for each in heard] == [
        *("/a heard within 2 s", "/a heard within 0.5 s")
    ]
    order = known(heard)
    assert {*order} == {(2, 0), (1, 3)}


@given(st.lists(NUMBERS, min_size=2, max_size=4, unique=True))
def test_all_that_holds_of_plain_cuts_is_known(limits: list[float]) -> None:
    cuts = tuple(Comparison("x", True, limit) for limit in limits)
    order = {*known(cuts)}
    wanted = {
        (2 * i, 2 * j)
        for i, one in enumerate(limits)
        for j, other in enumerate(limits)
        if one > other
    }
    assert order == wanted | {(b ^ 1, a ^ 1) for a, b in wanted}


def test_words_exclude_each_other_and_other_signals_have_nothing_to_say() -> None:
    cuts = (Choice("m", "a"), Choice("m", "b"), Choice("n", "a"))
    sensors = ["m=a", "door", "m=b", "n=a"]
    order = known_order(sensors, Wanted(conditions=cuts).every_condition())
    assert {*order} == {(0, 5), (4, 1)}


def test_cuts_are_recorded_as_they_are() -> None:
    texts = "> 20", "< 0.1", "> 1e-07 µm, off < 9e-08 µm", "= half open", "= a=b > 3"
    cuts = {"x y": tuple(parsed(text, "x y") for text in texts), "z": ()}
    assert recorded_signals(as_json(cuts)) == cuts


def plant(path: Path, rows: int = 4000) -> Path:
    """Write a tank whose pump runs while it is low, from half the time on at more."""
    draw, level, pumping, lines = random.Random(7), 50.0, False, []
    for row in range(rows):
        low = 30 + 40 * (2 * row > rows)
        pumping = level < low or (pumping and level < low + 50)
        level += draw.uniform(1, 9) if pumping else -draw.uniform(0, 9)
        lines.append(f"{level:.2f},{int(pumping)},{'fill' if pumping else 'rest'}")
    rows_of = (f"{row},{line}" for row, line in enumerate(lines))
    path.write_text("\n".join(["time,level,pump,mode", *rows_of, ""]))
    return path


def test_what_is_known_of_cuts_is_no_row_and_no_test(tmp_path: Path) -> None:
    readings = open_readings(str(plant(tmp_path / "tank.csv")))
    rows = {row.sentence for row in learned_from("tank", readings).rows}
    assert "pump and mode=fill: the same" in rows
    every = learned_from("tank", readings, every=True).rows
    known = [row for row in every if row.a[:5] == row.b[:5] == "level"]
    assert len(known) == 3
    assert rows
    assert not any(row.count("level") > 1 or row.count("mode") > 1 for row in rows)


def test_a_question_less_is_a_doubt_less(tmp_path: Path) -> None:
    lengths = range(60, 400, 10)
    found = [
        tuple(
            (judge(readings.columns, counts, known).codes[-1] > 0).item()
            for known in (None, np.arange(15) < 14)
        )
        for rows in lengths
        for readings in [open_readings(str(plant(tmp_path / "tank.csv", rows)))]
        for counts in [count_pairs(readings.columns)]
    ]
    assert (False, True) in found  # one pair that is tested needs less than fifteen
    assert (True, False) not in found


def test_a_run_of_a_file_keeps_the_cuts_of_its_beginning(tmp_path: Path) -> None:
    path = str(plant(tmp_path / "tank.csv"))
    settled = settle(path, {})
    assert settled == settle(path, settled)
    source = open_source(path, 0, settled)
    assert len(source.sensors) == 6
    assert source.sensors != tuple(open_readings(path).columns.sensorium)
    assert settle(path, {"bins": 2})["cuts"].count(">") == 1  # type: ignore[union-attr]
    with pytest.raises(InvalidValueError, match="level: must be 0 or 1"):
        open_source(path, 0, {"bins": 0})
    with pytest.raises(InvalidValueError, match="cuts: must be conditions"):
        open_source(path, 0, {"cuts": "[1]"})


def test_a_run_knows_the_order_of_its_cuts_before_it_has_learned(
    tmp_path: Path,
) -> None:
    path = str(plant(tmp_path / "tank.csv"))
    settled: dict[str, bool | int | float | str] = {"cuts": settle(path, {})["cuts"]}
    body = Body(own=open_source(path, 0, settled).sensors)
    options = RunOptions(source=path, body=body, arguments=settled)
    order = edge_matrix(12, options.known_order)
    assert order.sum() == 2 * 3 + 2
    core, learning = Coordinator(options), Learning(tmp_path, options)
    assert (core.graph.edges == order).all()
    assert (learning.snapshot.poc_graph().edges == order).all()
    agent = core.memory.to_bytes()
    learning.restore(wire.KeyFrame(1, core.snapshot.to_bytes(), agent=agent))
    assert (learning.snapshot.poc_graph().edges == order).all()


@pytest.mark.slow
def test_the_number_behind_a_sensor_is_recorded_and_told(tmp_path: Path) -> None:
    numbers = [37.25 * n % 100 for n in range(90)]
    rows = [f"{number},{int(number > 50)}\n" for number in numbers]
    data, log = tmp_path / "tank.csv", tmp_path / "tank.mcap"
    data.write_text("level,pump\n" + "".join(rows) + ",0\n1e39,1\n97.51,0\n")
    limits = {"when": "level > 50; level > 60", "sensors": "pump"}
    library.run(data, out=log, arguments=limits, cells="inline")
    said = call("watch", log).stdout
    assert "tick 93: pump is off while level>50 is on (97.51): never before" in said
    view = RunView(log)
    assert [frame.numbers for frame in view.frames(90, 93)] == [
        {0: numbers[-1], 1: numbers[-1]},
        {},  # unknown
        {},  # too large for what is recorded
        {0: 97.51, 1: 97.51},
    ]


def test_live_numbers_are_told_while_they_are_known() -> None:
    readers = SignalReaders(
        {"level": (parsed("level > 5"), parsed("level > 7")), "door": (None,)}
    )
    source = LiveSource(
        LatestReadings(readers.sensors, stale_after=5), Clocked(4), feeder=None
    )
    source.readers, source.numbers = readers, readers.numbers
    now = source._clock()
    source._clock = lambda: now
    found = []
    for seconds in (0, 4, 8):
        if not seconds:
            source.receive(readers.read({"level": "6.5"})[0])
        now += seconds and 4
        source.receive({"door": True})
        seen = source.first() if not seconds else source.step(-1)
        assert seen is not None
        found.append(numbers_in(seen.said, compared(map(parsed, ("x > 5", "x > 7")))))
        again = JournalRow.of(seen).observed(3)
        assert again.said == seen.said
    assert found == [{0: 6.5, 1: 6.5}, {0: 6.5, 1: 6.5}, {}]
