"""Help is readable: every command and option is explained, and options are grouped."""

import subprocess
import sys
from collections.abc import Iterator

import pytest
from typer.core import TyperCommand, TyperGroup, TyperOption

from neurosnap.apps.cli.run_flags import (
    AGENT,
    CELLS,
    LEARNING,
    NETWORK,
    RECORDING,
    SOURCE,
)
from tests.support.command_line import call, flat, refused, whole_command

GROUPS = (SOURCE, AGENT, LEARNING, CELLS, RECORDING, NETWORK)
GROUP = whole_command()


def commands(group: object = GROUP, before: str = "") -> Iterator[tuple[str, object]]:
    """Yield all verbs, those of a family by both their names."""
    assert isinstance(group, TyperGroup)
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup):
            yield from commands(command, f"{name} ")
        else:
            yield f"{before}{name}", command


VERBS = dict(commands())


def options(verb: str) -> list[TyperOption]:
    command = VERBS[verb]
    assert isinstance(command, TyperCommand)
    return [p for p in command.params if isinstance(p, TyperOption)]


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_explains_itself(verb: str) -> None:
    result = call(*verb.split(), "--help")
    assert (result.exit_code, result.stderr) == (0, "")
    assert "--format" in result.stdout
    for option in options(verb):
        assert (option.help or "").endswith((".", "...")), option.name
        assert not option.is_flag or option.metavar == "", option.name
        assert "--out" not in option.opts or "-o" in option.opts


def test_the_options_of_a_run_stand_in_groups() -> None:
    named = [each for each in options("run") if "--help" not in each.opts]
    alone = [each.name for each in named if each.rich_help_panel is None]
    assert alone == ["given", "view", "form"]
    text = call("run", "--help").stdout
    places = [text.index(f"─ {group} ─") for group in GROUPS]
    assert places == sorted(places)
    assert "Example: neurosnap run " in text
    assert "(logs/SOURCE" in text  # its bracket was not taken for a style
    defaults = {each.opts[0]: each.show_default for each in named}
    assert defaults["--threshold"] == "auto; discounted, 0.000125"


def test_the_help_of_all_has_what_each_verb_says_first() -> None:
    text = flat(call("--help").stdout)
    for verb in GROUP.list_commands(None):
        command = GROUP.commands[verb]
        said = (command.help or "").split("\n\n")[0]
        assert f"{verb} {flat(said)}" in text


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


@pytest.mark.slow
def test_what_is_like_a_verb_is_suggested_before_any_is_imported() -> None:
    program = [sys.executable, "-m", "neurosnap", "verfy"]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert "Did you mean 'verify'?" in flat(done.stderr)
