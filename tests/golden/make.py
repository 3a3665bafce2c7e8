"""Regenerates the stored golden results: ``python -m tests.golden.make``.

Of every kind of run, `meanings` holds what it comes to, and `messages` what the
coordinator says in it. What differs is replaced and named: look at it with ``git diff``
before it is committed. `runs` holds recordings of some.
"""

import shutil
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from tests.golden.meaning import meaning_of, message_lines
from tests.golden.scenarios import SCENARIOS, made

FOLDER = Path(__file__).parent


def stored(what: str, name: str) -> Path:
    """Return where `meanings` or `messages` of a scenario are stored."""
    return FOLDER / what / f"{name}.txt"


def make_scenarios() -> None:
    """Make all scenarios; store what they come to, and name what is new."""
    shutil.rmtree(FOLDER / "runs", ignore_errors=True)
    for scenario in SCENARIOS:
        with tempfile.TemporaryDirectory() as folder:
            lives = made(scenario, Path(folder) / f"{scenario.name}.mcap")
            if scenario.stored:
                shutil.copytree(folder, FOLDER / "runs", dirs_exist_ok=True)
        if not scenario.like:
            _store(stored("meanings", scenario.name), meaning_of(scenario, lives))
        _store(stored("messages", scenario.name), message_lines(lives))


def _store(path: Path, lines: Iterable[str]) -> None:
    text = "\n".join(lines) + "\n"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        sys.stdout.write(f"{path.parent.name}/{path.name} is new\n")
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    make_scenarios()
