"""Help that can be read: options in groups, whole names, no type beside a flag."""

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest
import typer
from typer.core import TyperGroup, TyperOption
from typer.testing import CliRunner

from neurosnap.apps.cli import app
from neurosnap.apps.cli.options import (
    AGENT,
    CELLS,
    LEARNING,
    NETWORK,
    RECORDING,
    SOURCE,
    SUPERVISION,
)

GROUPS = (SOURCE, AGENT, LEARNING, CELLS, RECORDING, SUPERVISION, NETWORK)


def options(verb: str = "") -> Iterator[TyperOption]:
    """Yield the options of a verb; of all verbs where none is named."""
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    for name, command in group.commands.items():
        inner = command.commands.values() if isinstance(command, TyperGroup) else ()
        for each in (command, *inner):
            if verb in ("", name):
                yield from (p for p in each.params if isinstance(p, TyperOption))


def names(verb: str) -> list[str]:
    return [
        name for each in options(verb) for name in (*each.opts, *each.secondary_opts)
    ]


def test_the_options_of_a_run_stand_in_groups() -> None:
    groups = {option.name: option.rich_help_panel for option in options("run")}
    alone = [name for name, group in groups.items() if group is None]
    assert alone == ["view", "as_json"]
    text = CliRunner().invoke(app, ["run", "--help"]).stdout
    places = [text.index(f"─ {group} ─") for group in GROUPS]
    assert places == sorted(places)
    assert "Example: neurosnap run " in text


def test_every_option_is_explained_and_no_flag_has_a_type() -> None:
    for option in options():
        assert option.help, option.name
        assert option.help.endswith((".", "...")), option.name
        if option.is_flag:
            assert option.metavar == "", option.name


@pytest.mark.parametrize("columns", [40, 70])
def test_names_of_options_are_whole_on_a_narrow_terminal(columns: int) -> None:
    told = subprocess.run(
        [sys.executable, "-m", "neurosnap", "run", "--help"],
        env={**os.environ, "COLUMNS": str(columns), "TERMINAL_WIDTH": str(columns)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    words = told.stdout.replace(",", " ").replace("/", " ").split()
    assert [name for name in names("run") if name not in words] == []


@pytest.mark.parametrize(
    ("flag", "default"),
    [
        ("--threshold", "auto; discounted, 0.000125"),
        ("--decay", "0.984375"),
        ("--ticks", "300; of a CSV file, all; from outside, until Ctrl-C"),
    ],
)
def test_a_default_that_depends_is_shown(flag: str, default: str) -> None:
    (option,) = (each for each in options("run") if flag in each.opts)
    assert option.show_default == default
