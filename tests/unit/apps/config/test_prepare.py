"""Requests made from a file that describes a run, and the command that checks one."""

import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest

from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.apps.config.problems import ConfigError
from neurosnap.apps.new_files import new_path
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.network import Network
from neurosnap.runtime.request import RunRequest, Supervision
from tests.support.command_line import call

DATABASE = Path(__file__).parents[3] / "golden" / "home-assistant_v2.db"
WORLD = '[source]\nkind = "world"\nid = "neurosnap/Path-v0"\narguments.places = 6\n'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "swarm.toml"


def write(file: Path, text: str) -> Path:
    file.write_text(text, encoding="utf-8")
    return file


def prepared(file: Path, text: str, **overrides: object) -> RunRequest:
    file.write_text(text, encoding="utf-8")
    dots = {key.replace("__", "."): value for key, value in overrides.items()}
    return prepare(load(file, dots))


# What is taken ------------------------------------------------------------------------


def test_what_is_left_out_is_as_without_a_file(file: Path) -> None:
    made = prepared(file, WORLD, recording__record=False)
    options = RunOptions(
        source="neurosnap/Path-v0",
        arguments={"places": 6},
        body=made.options.body,
        threshold="auto",
        watch=True,
    )
    assert made == RunRequest(options, supervision=Supervision())


def test_up_to_64_sensors_each_cell_is_a_process(file: Path) -> None:
    for sensors, kind in ((64, "process"), (65, "worker")):
        text = WORLD.replace("6", str(sensors + 1))
        options = prepared(file, text).options
        assert (len(options.sensors), options.cells) == (sensors, kind)


def test_what_is_given_is_taken(file: Path) -> None:
    text = f"""{WORLD}
        [run]
        ticks = 9
        seed = 5
        [agent]
        kind = "planner"
        target = "below_1, below_2*"
        explore = 1
        [snapshot]
        kind = "discounted"
        threshold = 0.25
        decay = 0
        [cells]
        kind = "worker"
        workers = 3
        wiring = "derived"
        deadline = 2
        [anomalies]
        watch = false
        hold = 3
        [recording]
        folder = "unused"
        path = "one.mcap"
        keyframe_every = 4
        [supervision]
        restart_on_error = true
        max_restarts = 0
        backoff = 0
        [network]
        listen = "tcp/127.0.0.1:0"
        insecure = true
        """
    made = prepared(file, text)
    options = made.options
    assert options == RunOptions(
        source="neurosnap/Path-v0", arguments={"places": 6}, body=options.body,
        agent="planner", target=("below_1", "below_2*"), explore=1.0, ticks=9, seed=5,
        snapshot="discounted", threshold=0.25, decay=0.0, wiring="derived",
        cells="worker", workers=3, keyframe_every=4, deadline=2.0, watch=False, hold=3,
    )  # fmt: skip
    assert made.log == file.parent / "one.mcap"
    assert made.supervision == Supervision(
        restart_on_error=True, max_restarts=0, backoff=0
    )
    assert made.site.network == Network(listen="tcp/127.0.0.1:0", insecure=True)
    assert not made.log.exists()


def test_paths_are_relative_to_the_file(file: Path) -> None:
    (file.parent / "readings.csv").write_text("a,b\n0,1\n1,1\n")
    text = (
        "[source]\nkind = 'file'\npath = 'readings.csv'\n[recording]\nfolder = 'new'\n"
    )
    made = prepared(file, text)
    assert made.options.source == str(file.parent / "readings.csv")
    assert made.log is not None
    assert made.log.parent == file.parent / "new"
    assert made.log.name.startswith("readings-")
    assert not made.log.parent.exists()


def test_keys_are_looked_for_beside_the_file(file: Path) -> None:
    text = f"{WORLD}[network]\nlisten = 'tls/localhost:1'\ntls = 'keys'\n"
    place = f"{file}:7: network.tls: {file.parent / 'keys' / 'ca.pem'}: must be a file"
    with pytest.raises(ConfigError, match=re.escape(place)):
        prepare(load(write(file, text)))


@pytest.mark.parametrize(
    ("asked", "taken"), [({}, 3), ({"run__ticks": 2}, 2), ({"run__ticks": 9}, 3)]
)
def test_a_file_of_readings_ends(
    file: Path, asked: Mapping[str, object], taken: int
) -> None:
    (file.parent / "readings.csv").write_text("a,b\n0,1\n1,1\n0,0\n")
    text = "source = {kind = 'file', path = 'readings.csv'}"
    assert prepared(file, text, **asked).options.ticks == taken


def test_what_has_times_is_judged_by_the_clock_of_its_home(file: Path) -> None:
    """A table has UTC's, a database its home's; one without times is not judged."""
    source, asked = file.parent / "readings.csv", "source = {kind = 'file', path = "
    text = f"{asked}'readings.csv'}}"
    source.write_text("a,b\n0,1\n1,1\n")
    found = [prepared(file, text).options]
    source.write_text("time,a,b\n2026-07-01 12:00:00,0,1\n2026-07-01 12:01:00,1,1\n")
    found.append(prepared(file, text).options)
    shutil.copy(DATABASE, source)
    (file.parent / ".storage").mkdir()
    settings = '{"data": {"time_zone": "Europe/Berlin"}}'
    (file.parent / ".storage" / "core.config").write_text(settings)
    found.append(prepared(file, text).options)
    found.append(prepared(file, text, health__alarms="2/month").options)
    assert [(options.alarms, options.zone) for options in found] == [
        ("never", "UTC"),
        ("1/week", "UTC"),
        ("1/week", "Europe/Berlin"),
        ("2/month", "Europe/Berlin"),
    ]


@pytest.mark.parametrize("target", ["3", "'3'"])
def test_an_excited_agent_is_drawn_to_a_place(file: Path, target: str) -> None:
    text = f"{WORLD}[agent]\nkind = 'excited'\ntarget = {target}\n"
    options = prepared(file, text).options
    assert (options.arguments, options.target) == ({"places": 6, "target": 3}, ())
    assert {"better", "worse"} <= set(options.body.own)


# What goes before the file ------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "given", "said"),
    [
        (
            f"{WORLD}[agent]\nexplore = 3\n",
            {
                "snapshot.threshold": 0.7,
                "source.arguments.x": [1],
                "cells": {"kind": "none"},
            },
            [
                "source.arguments.x: must be true or false, a whole number, a finite",
                "threshold: must be a number in (0, 0.25] or 'auto', got 0.7",
                "cells: kind: must be 'auto', 'inline', 'process' or 'worker'",
                "swarm.toml:6: agent.explore: must be a number in [0, 1] or 'planned'",
            ],
        ),
        (
            f"{WORLD}[snapshot]\nkind = 'empirical'\n",
            {"snapshot.decay": 0.5},
            ["decay: must go with a discounted snapshot only, got 0.5"],
        ),
        (
            f"snapshot = 3\n{WORLD}",
            {"snapshot.threshold": 0.1},
            ["swarm.toml:1: snapshot: must be a table, got 3"],
        ),
    ],
)
def test_what_is_wrong_with_it_has_no_line_but_a_name(
    file: Path, text: str, given: dict[str, object], said: list[str]
) -> None:
    names = {
        "snapshot.threshold": "threshold",
        "snapshot.decay": "decay",
        "cells": "cells",
    }
    with pytest.raises(ConfigError) as caught:
        prepare(load(write(file, text), given, names))
    lines = str(caught.value).replace(f"{file.parent}/", "").splitlines()
    assert all(line.startswith(it) for line, it in zip(lines, said, strict=True)), lines


# The command --------------------------------------------------------------------------


def test_check_says_that_nothing_is_wrong(file: Path) -> None:
    write(file, WORLD)
    plain = call("check", file)
    assert (plain.exit_code, plain.stdout) == (0, f"{file}: no faults\n")
    told = call("check", file, "--format", "json")
    assert json.loads(told.stdout) == {"file": str(file), "faults": [], "more": 0}


def test_check_says_what_is_wrong_and_where(file: Path) -> None:
    write(file, f"{WORLD}[agent]\nexplore = 2\n[[run]]\n")
    told = call("check", file, "--format", "json")
    assert told.exit_code == 2
    first, second = told.stderr.splitlines()
    assert (
        first
        == f"error: {file}:6: agent.explore: must be a number in [0, 1] or 'planned', got 2"
    )
    assert second == f"{file}:7: run: must be a table, got [{{}}]"
    assert json.loads(told.stdout)["faults"][1] == {
        "file": str(file),
        "line": 7,
        "key": "run",
        "said": "must be a table, got [{}]",
    }


# Where it is recorded -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("neurosnap/Path-v0", "path"),
        ("", "run"),
        ("mqtt:", "mqtt"),
        ("-", "stdin"),
        ("gymnasium:CartPole-v1", "gymnasium-cartpole-v1"),
        ("a/Größe 2: <neu>?.csv", "größe-2-neu"),
        ("x" * 300, "x" * 60),
    ],
)
def test_a_recording_has_a_name_that_can_be_copied_anywhere(
    tmp_path: Path, source: str, name: str
) -> None:
    assert new_path(source).parent == Path("logs")
    stem, _, _ = new_path(source, tmp_path).name.rsplit("-", 3)[0].partition(".")
    assert stem == name
    assert not list(tmp_path.iterdir())
