"""Help that can be read: few verbs in panels, options in groups, whole names."""

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
)
from tests.support.command_line import call, refused

GROUPS = (SOURCE, AGENT, LEARNING, CELLS, RECORDING, NETWORK)
LEAVING = {"figures", "model"}
"""Verbs of the paper's experiments."""
WORDS = {"--cells", "--workers", "--tls", "--listen", "--out", "--force"}
"""Options that mean one thing, wherever they are."""


def commands() -> Iterator[tuple[str, typer.core.TyperCommand]]:
    """Yield all verbs, those of a family by both their names."""
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup):
            for inner, each in command.commands.items():
                assert isinstance(each, typer.core.TyperCommand)
                yield f"{name} {inner}", each
        elif name not in LEAVING:
            assert isinstance(command, typer.core.TyperCommand)
            yield name, command


VERBS = [name for name, _ in commands()]


def options(verb: str) -> list[TyperOption]:
    return [p for p in dict(commands())[verb].params if isinstance(p, TyperOption)]


def test_verbs_are_few_and_stand_in_panels() -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    assert len(group.commands.keys() - LEAVING) <= 18
    for name, command in group.commands.items():
        panel = getattr(command, "rich_help_panel", None)
        assert name in LEAVING or isinstance(panel, str), name


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_explains_itself(verb: str) -> None:
    result = call(*verb.split(), "--help")
    assert (result.exit_code, result.stderr) == (0, "")
    if verb != "init schema":
        assert "--format" in result.stdout
    for option in options(verb):
        assert option.help, option.name
        assert option.help.endswith((".", "...")), option.name
        if option.is_flag:
            assert option.metavar == "", option.name
        if "--out" in option.opts:
            assert "-o" in option.opts


def test_an_option_is_of_one_kind_in_all_verbs() -> None:
    kinds: dict[str, set[bool]] = {}
    for verb in VERBS:
        for option in options(verb):
            for name in WORDS & set(option.opts):
                kinds.setdefault(name, set()).add(option.is_flag)
    assert kinds == {name: {name == "--force"} for name in WORDS}


def test_the_options_of_a_run_are_few_and_stand_in_groups() -> None:
    named = [each for each in options("run") if "--help" not in each.opts]
    assert len(named) <= 18
    alone = [each.name for each in named if each.rich_help_panel is None]
    assert alone == ["given", "view", "form"]
    text = CliRunner().invoke(app, ["run", "--help"]).stdout
    places = [text.index(f"─ {group} ─") for group in GROUPS]
    assert places == sorted(places)
    assert "Example: neurosnap run " in text
    assert "(logs/SOURCE" in text  # its bracket was not taken for a style


def test_names_of_options_are_whole_on_a_narrow_terminal() -> None:
    columns = 40
    told = subprocess.run(
        [sys.executable, "-m", "neurosnap", "run", "--help"],
        env={**os.environ, "COLUMNS": str(columns), "TERMINAL_WIDTH": str(columns)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    words = told.stdout.replace(",", " ").replace("/", " ").split()
    names = [n for each in options("run") for n in (*each.opts, *each.secondary_opts)]
    assert [name for name in names if name not in words] == []


@pytest.mark.parametrize(
    ("flag", "default"),
    [
        ("--threshold", "auto; discounted, 0.000125"),
        ("--ticks", "300; of a CSV file, all; from outside, until Ctrl-C"),
    ],
)
def test_a_default_that_depends_is_shown(flag: str, default: str) -> None:
    (option,) = (each for each in options("run") if flag in each.opts)
    assert option.show_default == default


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("verfy", "No such command 'verfy'. Did you mean 'verify'?"),
        ("fly", "No such command 'fly'."),
    ],
)
def test_a_verb_that_does_not_exist_is_wrong_usage(word: str, said: str) -> None:
    assert said in refused(word)
    assert call().exit_code == 2
