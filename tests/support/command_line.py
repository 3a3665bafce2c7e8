"""Verbs of `neurosnap` called in this process."""

import json
from typing import Any

from typer.testing import CliRunner, Result

from neurosnap.apps.cli import app


def call(*arguments: object, stdin: str | None = None) -> Result:
    """Call a verb; whatever goes wrong, nobody gets a traceback to read."""
    result = CliRunner().invoke(app, [str(one) for one in arguments], input=stdin)
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


def facts_of(result: Result) -> dict[str, Any]:
    """Return the JSON that a verb ends with."""
    facts = json.loads(result.stdout.splitlines()[-1])
    assert isinstance(facts, dict)
    return facts
