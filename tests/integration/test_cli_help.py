"""The command line explains its verbs."""

import pytest

from neurosnap.apps.cli import app
from tests.support.command_line import call, refused

pytestmark = pytest.mark.slow

VERBS = (
    "run",
    "learn",
    "health",
    "replay",
    "depth",
    "info",
    "graph",
    "doctor",
    "salvage",
    "export",
    "hub",
    "ps",
    "stop",
    "coordinate",
    "world",
    "record",
    "join",
    "watch",
    "view",
    "topics",
    "keys",
)


def test_every_verb_is_known_here() -> None:
    callbacks = [info.callback for info in app.registered_commands]
    assert [getattr(verb, "__name__", None) for verb in callbacks] == list(VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_explains_itself(verb: str) -> None:
    result = call(verb, "--help")
    assert result.exit_code == 0
    assert "--json" in result.stdout
    assert result.stderr == ""


def test_help_says_what_happens_without_an_option() -> None:
    said = call("run", "--help").stdout
    assert "(logs/SOURCE" in said  # its bracket was not taken for a style
    assert "Example: neurosnap run" in said


def test_help_lists_the_verbs() -> None:
    result = call("--help")
    assert result.exit_code == 0
    assert all(verb in result.stdout for verb in VERBS)


def test_no_verb_is_wrong_usage() -> None:
    assert call().exit_code == 2
    assert "No such command 'fly'" in refused("fly")
