"""Calls `neurosnap` commands in this process."""

import json
from typing import Any

import typer
from typer.testing import CliRunner, Result

from neurosnap.apps.cli import app


def whole_command() -> Any:
    """Return the program with all its verbs."""
    program: Any = typer.main.get_command(app)
    for verb in program.list_commands(None):
        program.get_command(None, verb)
    return program


def call(*arguments: object, stdin: str | None = None) -> Result:
    """Call a verb; no error may show a traceback."""
    result = CliRunner().invoke(app, [str(one) for one in arguments], input=stdin)
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


def last_json(stdout: str) -> dict[str, Any]:
    facts = json.loads(stdout.splitlines()[-1])
    assert isinstance(facts, dict)
    return facts


def happy(*arguments: object) -> dict[str, Any]:
    """Run a command that succeeds; return the JSON object it prints last."""
    result = call(*arguments, "--format", "json")
    assert result.exit_code == 0, result.stderr
    return last_json(result.stdout)


def refused(*arguments: object) -> str:
    """Run a command that is used wrongly; return what it says of it, on one line."""
    result = call(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    return flat(result.stderr)


def failed(*arguments: object) -> str:
    """Run a command that fails; return what it says of it, on one line."""
    result = call(*arguments)
    assert result.exit_code == 1, result.output
    return flat(result.stderr)


def flat(text: str) -> str:
    """Return a text without the frames and line breaks of its layout."""
    return " ".join(text.translate(str.maketrans("│─╭╮╰╯", " " * 6)).split())
