"""Exports of a run that grows sensors: by their formula, from their birth on."""

import asyncio
import csv
import json
from pathlib import Path

import networkx
import pytest
from typer.testing import CliRunner

from neurosnap.apps.cli import app
from neurosnap.apps.export.write import Form, export
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from tests.support.lamp import BIRTH, GROWN, lamp_options

TICKS, SENSORS = 40, 24
"""Ticks; that of the birth; sensors at first; and what is grown."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lamp") / "lamp.mcap"
    options = lamp_options(ticks=TICKS, cells="inline")
    asyncio.run(run(RunRequest(options, path), asyncio.Event()))
    return path


def written(log: Path, form: Form, out: Path) -> Path:
    return Path(export(log, form, out).path)


def test_a_table_has_a_column_of_what_is_grown_and_none_of_what_is_not(
    log: Path, tmp_path: Path
) -> None:
    with written(log, "csv", tmp_path / "t.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert not any(name.startswith("grown ") for name in rows[0])
    assert {row[GROWN] for row in rows[:BIRTH]} == {""}
    assert {row[GROWN] for row in rows[BIRTH:]} == {"0", "1"}
    assert {len(row["state"]) for row in rows} == {SENSORS + 1}
    grew = [(int(row["tick"]), row["grew"]) for row in rows if row["grew"]]
    assert grew == [(BIRTH, GROWN)]
    assert {row["retired"] for row in rows} == {""}


@pytest.mark.parametrize(("at", "sensors"), [(BIRTH - 1, 24), (BIRTH, 25)])
def test_the_order_has_what_was_grown_by_then(
    at: int, sensors: int, log: Path, tmp_path: Path
) -> None:
    given = ["learn", str(log), "--at", str(at)]
    table = CliRunner().invoke(app, given).stdout
    assert f" of {sensors} sensors in {at} ticks" in table
    found = json.loads(CliRunner().invoke(app, [*given, "--format", "json"]).stdout)
    assert found["sensors"] == sensors
    found = found["order"]
    assert len(found["sensors"]) == sensors
    assert found["room"] == 3 - (sensors - SENSORS)
    born = [(each["tick"], each["name"]) for each in found["births"]]
    assert born == [(BIRTH, GROWN)] * (sensors - SENSORS)
    path = tmp_path / "g.graphml"
    export(log, "graphml", path, at=at)
    graph = networkx.read_graphml(path)
    ticks = {name: tick for name, tick in graph.nodes(data="born") if tick is not None}
    assert set(ticks) <= {GROWN, f"{GROWN}*"}
    assert set(ticks.values()) == {tick for tick, _ in born}
