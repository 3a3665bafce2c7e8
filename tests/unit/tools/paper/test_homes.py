"""Faults, baselines and the tables of the homes figure are as specified."""

import csv
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from tests.support.lived_in import SENSORS, lived_in
from tools.paper import fig8_homes, run
from tools.paper.figure import FigureOptions
from tools.paper.homes import cases, simulated
from tools.paper.homes.baselines import Groups, Silence
from tools.paper.homes.faults import SINGLE, affected, differing, faulty, with_false
from tools.paper.homes.flagged_sensors import Mention, joined
from tools.paper.homes.home import Home, merged, read_home
from tools.paper.homes.methods import METHODS, Bench, credited
from tools.paper.homes.simulated import simulated_home


def home_of(days: int, seed: int) -> Home:
    made: list[list[tuple[float, float]]] = [[] for _ in SENSORS]
    for on, off, sensor in lived_in(days, seed):
        made[sensor].append((on, off))
    spans = tuple(merged(np.array(own).reshape(-1, 2)) for own in made)
    begin = min(float(own[0, 0]) for own in spans)
    return Home(SENSORS, spans, begin, max(float(s[-1, 1]) for s in spans))


SPANS = st.lists(st.tuples(st.integers(0, 50), st.integers(0, 8)), max_size=8)


def covered(spans: np.ndarray) -> set[int]:
    return {s for on, off in spans.tolist() for s in range(int(on), int(off))}


def spans_of(drawn: list[tuple[int, int]]) -> np.ndarray:
    made = [(float(on), float(on + lasts)) for on, lasts in drawn]
    return merged(np.array(made).reshape(-1, 2))


def test_a_home_is_read_from_intervals_and_from_a_table(tmp_path: Path) -> None:
    path = tmp_path / "one.sensors"
    path.write_text("10 5 24\n12 10 3\n13 1 24\n30 0 3\n")
    found = read_home(path)
    assert found.sensors == ("s24", "s3")
    assert [s.tolist() for s in found.spans] == [[[10, 15]], [[12, 22], [30, 30]]]
    path = tmp_path / "one.csv"
    path.write_text("time,a,b\n10,0,1\n20,1,1\n30,1,\n40,0,1\n")
    # Unknown is not on; what is on at the end was on until then.
    spans = [s.tolist() for s in read_home(path).spans]
    assert spans == [[[20, 40]], [[10, 30], [40, 40]]]


@given(SPANS)
def test_merged_spans_cover_the_same_and_are_apart(
    drawn: list[tuple[int, int]],
) -> None:
    found = spans_of(drawn)
    assert covered(found) == {s for on, n in drawn for s in range(on, on + n)}
    assert (found[1:, 0] > found[:-1, 1]).all()


@given(SPANS, SPANS)
def test_differing_is_exclusive_or(
    one: list[tuple[int, int]], other: list[tuple[int, int]]
) -> None:
    a, b = spans_of(one), spans_of(other)
    assert covered(differing(a, b)) == covered(a) ^ covered(b)


@pytest.mark.parametrize("kind", SINGLE)
def test_a_fault_changes_its_sensors_and_nothing_before_it(kind: str) -> None:
    home = home_of(10, 1)
    onset, end = home.begin + 5 * 86400, home.end + 1
    broken = faulty(home, kind, 2, onset, end, np.random.default_rng(0))
    changed = affected(home, broken)
    assert 2 in changed
    assert len(changed) == (2 if kind == "swapped" else 1)
    for sensor in changed:
        before, now = home.spans[sensor], broken.spans[sensor]
        early = before[before[:, 1] < onset]
        assert np.array_equal(early, now[: len(early)])
        if kind == "fail-stop":
            assert (now[:, 1] <= onset).all()
        if kind == "stuck on":
            assert now[-1].tolist() == [onset, end]


def test_false_activations_are_added() -> None:
    own = home_of(10, 1).spans[1]
    begin = own[0, 0] + 5 * 86400
    more = with_false(own, 50, begin, begin + 86400, np.random.default_rng(0))
    assert covered(own) <= covered(more)
    assert len(own) + 40 <= len(more) <= len(own) + 50


def test_mentions_join_within_an_hour() -> None:
    points = [(0.0, 1), (100.0, 2), (3000.0, 1), (9000.0, 1)]
    expected = [Mention(1, 0, 3060), Mention(2, 100, 160), Mention(1, 9000, 9060)]
    assert joined(points, 60) == expected


def test_no_credit_for_what_the_twin_says_too() -> None:
    found = [
        Mention(1, 10, 20),
        Mention(1, 50, 60),
        Mention(2, 55, 60),
        Mention(3, 5, 9),
    ]
    twin = [Mention(1, 48, 70)]
    assert credited(found, twin, 8) == [Mention(1, 10, 20), Mention(2, 55, 60)]


def test_the_silence_rule_is_its_definition() -> None:
    # Sensor 0 comes on every third time; at most two others come on in between.
    times = np.arange(120.0) * 100
    who = np.where(np.arange(120) % 3 == 0, 0, 1)
    spans = tuple(
        np.column_stack([times[who == s], times[who == s] + 1]) for s in (0, 1)
    )
    home = Home(("a", "b"), spans, 0.0, 12000.0)
    rule = Silence(home, 9000.0, 1.5)
    assert rule.mentions(home, 9000.0, 12000.0) == []
    silent = home.with_spans({0: spans[0][spans[0][:, 0] < 9000]})
    # The 91st event is the fourth after the last activation, more than 1.5 times 2.
    assert rule.since(silent, 0, 9000.0, 12000.0) == 9200.0


def test_the_silence_rule_tells_no_more_than_the_monitor() -> None:
    methods = Bench(home_of(21, 3), "1/week")
    rule, monitor = (len(methods.clean(name)) for name in ("silence rule", "health"))
    assert rule <= monitor


def test_a_simulated_home_is_read_as_it_was_made(tmp_path: Path) -> None:
    simulated.main(tmp_path, homes=1)
    (path,) = tmp_path.iterdir()
    read, made = read_home(path), simulated_home(0)
    used = [own for own in made.spans if len(own)]
    assert read.zone == made.zone != "UTC"
    assert sum(map(len, read.spans)) == sum(map(len, used))
    assert made.begin <= read.begin < read.end <= made.end
    assert {len(simulated_home(seed).spans) for seed in range(4)} > {len(made.spans)}


def test_a_simulated_home_lives_by_its_clock() -> None:
    """No habit begins before six; a pet and a machine alone are up at night."""
    home = simulated_home(0)
    zone = ZoneInfo(home.zone)
    starts = np.concatenate([own[:, 0] for own in home.spans])
    hours = np.array([datetime.fromtimestamp(at, zone).hour for at in starts])
    assert 0 < (hours < 5).mean() < 0.2


def test_groups_name_what_is_new() -> None:
    times = np.arange(100.0) * 600
    spans = (
        np.column_stack([times, times + 1]),
        np.column_stack([times + 20, times + 21]),
    )
    home = Home(("a", "b"), spans, 0.0, 60000.0)
    lone = home.with_spans({1: spans[1][spans[1][:, 0] < 54000]})
    # The first alone was never seen; no minute at all and both are equally near.
    said = Groups(home, 54000.0).mentions(lone, 54000.0, 60000.0)
    assert len(said) == 1
    assert Groups(home, 54000.0).mentions(home, 54000.0, 60000.0) == []


def test_an_interval_holds_its_value_and_shrinks_with_cases() -> None:
    rng = np.random.default_rng(0)
    few, many = (rng.random(n) < 0.3 for n in (20, 2000))
    widths = []
    for hits in (few, many):
        value, low, high = fig8_homes.ratio(hits.astype(float), np.ones(len(hits)))
        assert value == pytest.approx(hits.mean())
        assert low <= value <= high
        widths.append(high - low)
    assert widths[1] < widths[0] / 5
    assert fig8_homes.median(np.array([1.0, np.inf, 2.0]))[0] == 2.0


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_figure_of_homes_has_every_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cases, "CASES", 3)
    monkeypatch.setattr(cases, "ONSETS", 1)
    lines = [f"{a:.0f} {b - a:.0f} {s}\n" for a, b, s in lived_in(21, 3)]
    (tmp_path / "one.sensors").write_text("".join(lines))
    given_ = FigureOptions(
        only=("homes",), homes=tmp_path, runs=1, out=tmp_path / "out", workers=0
    )
    (made,) = run.run_figures(given_)
    with made.files[0].open(newline="") as file:
        rows = list(csv.DictReader(file))
    tables = {row["table"] for row in rows}
    assert tables == {"segments", "long", "week", "clean"}
    assert {row["method"] for row in rows} == {*METHODS, "always alarm"}
    found = {
        (row["faults"], row["method"]): float(row["value"])
        for row in rows
        if (row["table"], row["measure"]) == ("long", "found")
    }
    assert found["fail-stop", "health"] >= found["fail-stop", "logistic"]
    assert made.lines[0].startswith("| home | table |")


def test_without_homes_the_figure_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"^homes: must be a folder"):
        run.run_figures(FigureOptions(only=("homes",), out=tmp_path))
    with pytest.raises(InvalidValueError, match=r"^homes: must be a folder with files"):
        run.run_figures(FigureOptions(only=("homes",), out=tmp_path, homes=tmp_path))
