"""Tests of ``neurosnap learn`` and its table from the command line."""

import csv
from pathlib import Path

import numpy as np
import pytest

from tests.support.command_line import call, happy, refused
from tests.support.sources import written

READINGS = Path(__file__).parents[2] / "examples" / "readings.csv"


def test_a_csv_file_has_the_same_rows(tmp_path: Path) -> None:
    facts = happy("learn", READINGS)
    told = [(row["sentence"], row["relation"]) for row in facts["relations"]]
    out = tmp_path / "table.csv"
    for force in ((), ("--force",)):
        assert f"wrote {out}" in call("learn", READINGS, "--out", out, *force).stdout
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["sentence"], row["relation"]) for row in rows] == told
    assert ("motor for 1 tick implies moving (explains 41)", "implies late") in told


def test_the_page_loads_nothing_and_shows_strange_names_as_they_are(
    tmp_path: Path,
) -> None:
    bits = np.random.default_rng(0).random(500) < 0.5
    rows = "".join(f"{int(bit)},{int(bit)}\n" for bit in bits)
    data = written(tmp_path, f"<script>alert(1)</script>,a&b\n{rows}")
    out = tmp_path / "page.html"
    assert call("learn", data, "--out", out).exit_code == 0
    page = out.read_text()
    assert "content=\"default-src 'none'; style-src 'unsafe-inline'\"" in page
    assert [mark for mark in ("src=", "href=", "<script", "url(") if mark in page] == []
    assert page.count("<svg") == 1
    assert page.count("<rect") == 2  # an element and its complement


def test_little_data_is_said_to_be_little(tmp_path: Path) -> None:
    result = call("learn", written(tmp_path, "a,b\n0,0\n0,1\n1,1\n"))
    assert result.exit_code == 0
    assert "0 relations of 2 sensors in 3 ticks" in result.stdout
    assert "--threshold" in result.stdout
    data = tmp_path / "readings.csv"
    facts = happy("learn", data, "--threshold", 0.25)
    assert [row["b"] for row in facts["relations"]] == ["b"]
    assert facts["learned"] == "threshold 0.25"
    assert happy("learn", data, "--threshold", "auto")["learned"] == "threshold auto"


def test_more_sensors_than_fit_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("neurosnap.apps.export.relations.free_memory", lambda: 4000)
    said = refused("learn", READINGS)
    assert "sensors: must be fewer here: their pairs take 0.0 GB" in said
    assert call("learn", READINGS, "--sensors", "m*").exit_code == 0


def test_a_recording_has_the_same_table(path_log: Path) -> None:
    table = happy("learn", path_log)
    assert table["learned"] == "learned by tick 40"
    told = {(row["a"], row["b"]) for row in table["relations"]}
    assert len(told) == len(table["relations"])
    assert ("below_6", "below_7") in told
    shown = call("learn", path_log).stdout
    assert "below_6 implies below_7" in shown
    assert "learned by tick 12" in call("learn", path_log, "--at", 12).stdout
    assert happy("learn", path_log, "--threshold", 0.01)["ticks"] == 40


def test_the_order_of_numbers_is_known_to_a_run_and_is_not_told(
    tmp_path: Path,
) -> None:
    draw = np.random.default_rng(4)
    rows = "".join(f"{draw.integers(100)},{draw.integers(2)}\n" for _ in range(60))
    data, log = written(tmp_path, f"level,door\n{rows}"), tmp_path / "run.mcap"
    ran = happy("run", data, "--cells", "inline", "--ticks", 30, "--out", log)
    assert not [pair for pair in ran["implications"] if "level" in pair[0] + pair[1]]
    assert call("verify", log).exit_code == 0
    more = tmp_path / "more.mcap"
    happy("resume", log, data, "--ticks", 60, "--out", more)
    assert call("verify", more).exit_code == 0
    relations = happy("learn", more, "--all")["relations"]
    assert sum(row["a"][:5] == row["b"][:5] == "level" for row in relations) == 3
    assert not [row for row in happy("learn", more)["relations"] if row["a"][0] == "l"]
