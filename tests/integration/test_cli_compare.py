"""Tests of ``neurosnap compare`` from the command line."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.support.command_line import call, happy, last_json, refused
from tests.support.sources import written


def line(
    folder: Path, name: str, seed: int, *, wrong: float = 0, more: str = ""
) -> Path:
    """Write readings of a belt that follows a motor, and of a level of 0 to 99."""
    chance = np.random.default_rng(seed)
    on = np.repeat(np.arange(3000) % 2, chance.integers(2, 9, 3000))[:3000]
    belt = on ^ (chance.random(3000) < wrong)
    level = chance.integers(100, size=3000) + (20 if wrong else 0)
    rows = "".join(
        f"{a},{b},{c}{',0' if more else ''}\n"
        for a, b, c in zip(on, belt, level, strict=True)
    )
    head = f"motor,belt,level{',' * bool(more)}{more}\n"
    return written(folder, head + rows, name)


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return line(tmp_path, "good.csv", 1)


def test_what_did_not_change_is_the_same(good: Path, tmp_path: Path) -> None:
    again = line(tmp_path, "again.csv", 2)
    facts = happy("compare", good, again)
    assert (facts["changed"], facts["differences"], facts["relations"]) == (
        False,
        [],
        1,
    )
    assert facts["ticks"] == [3000, 3000]
    assert "same: nothing differs beyond chance" in call("compare", good, again).stdout


@pytest.mark.slow
def test_what_changed_ends_with_one_and_is_written_whole(
    good: Path, tmp_path: Path
) -> None:
    new = line(tmp_path, "new.csv", 2, wrong=0.05)
    shown = call("compare", good, new)
    assert shown.exit_code == 1
    assert "motor and belt: the same" in shown.stdout
    facts = last_json(call("compare", good, new, "--format", "json").stdout)
    assert facts["changed"] is True
    changes = {(each["change"], each["relation"]) for each in facts["differences"]}
    assert {
        ("weaker", "motor and belt: the same"),
        ("more", "belt comes on"),
    } <= changes
    # The second is cut as the first is: what was a quarter is less.
    assert any("level>75 is on" in relation for _, relation in changes)
    assert not facts["only_first"] + facts["only_second"]
    for ending in "csv", "json", "html":
        out = tmp_path / f"out.{ending}"
        for force in (), ("--force",):
            result = call("compare", good, new, "--out", out, *force)
            assert result.exit_code == 1
            assert f"wrote {out}" in result.stdout
    assert json.loads((tmp_path / "out.json").read_text()) == facts
    with (tmp_path / "out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {(row["change"], row["relation"]) for row in rows} == changes
    page = (tmp_path / "out.html").read_text()
    assert page.count("<tr>") == 1 + len(rows)
    assert [mark for mark in ("src=", "href=", "<script", "url(") if mark in page] == []


def test_a_sensor_of_one_only_is_said(good: Path, tmp_path: Path) -> None:
    result = call("compare", good, line(tmp_path, "new.csv", 2, more="door"))
    assert result.exit_code == 3
    assert f"only in {tmp_path / 'new.csv'}: door" in result.stdout
    numbers = tmp_path / "new.csv"
    numbers.write_text(numbers.read_text().replace(",0\n", ",7\n", 900))
    result = call("compare", good, numbers)
    assert result.exit_code == 3
    assert f"only in {numbers}: door>0" in result.stdout
    other = written(tmp_path, "lamp\n0\n1\n", "other.csv")
    assert "must have a sensor of" in refused("compare", good, other)


def test_a_recording_is_compared(path_log: Path) -> None:
    facts = happy("compare", path_log, path_log)
    assert (facts["changed"], facts["ticks"]) == (False, [40, 40])
    assert facts["only_first"] == facts["only_second"] == []
