"""Plants small bugs one by one, and reports those that no test notices.

Each row of `mutants.toml` is a bug: a text in a file, what it becomes, and the tests
that are to fail then. A row whose text is not there once is an error: the code has
moved, and the row has to follow it.

    .venv/bin/python -m tools.mutants [WORD ...]

runs the rows that have one of the words in their file or their reason. The tree is
copied to `build/mutants` first; the working copy is never touched.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Literal, TypeAlias

import msgspec

HERE = Path(__file__).resolve().parents[2]
TREE = HERE / "build" / "mutants"
"""Always the same place: compiled code is kept by where its source is."""
TABLE = Path(__file__).with_name("mutants.toml")
_LONGEST = 120.0  # seconds for the tests of a mutant, the kernels' compiling included

Outcome: TypeAlias = Literal["caught", "NOT CAUGHT", "NO LONGER APPLIES"]


class Mutant(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One small bug."""

    file: str
    """Where, from the root of the repository."""
    old: str
    """A text that is there exactly once."""
    new: str
    """What it becomes."""
    why: str
    """What goes wrong then."""
    tests: list[str]
    """What is given to pytest: files or single tests, all of them quick."""


def mutants(words: list[str]) -> list[Mutant]:
    """Return the rows that have one of `words`, or all if there are none."""
    found = msgspec.toml.decode(TABLE.read_bytes(), type=dict[str, list[Mutant]])
    return [
        one
        for one in found["mutant"]
        if not words or any(word in f"{one.file} {one.why}" for word in words)
    ]


def copy_tree() -> None:
    """Copy all files that git knows of, or would take, to `TREE`."""
    command = ["git", "ls-files", "-z", "-co", "--exclude-standard"]
    listed = subprocess.run(command, cwd=HERE, check=True, capture_output=True)
    shutil.rmtree(TREE, ignore_errors=True)
    for name in filter(None, listed.stdout.decode().split("\0")):
        source, target = HERE / name, TREE / name
        if source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)


def passes(tests: list[str]) -> bool:
    """Tell whether tests are there, and pass in the copy."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    command += ["--no-header", "--hypothesis-profile=quick", *tests]
    environment = {
        **os.environ,
        "PYTHONPATH": str(TREE),
        "PYTHONDONTWRITEBYTECODE": "1",  # what is changed within a second is not seen
    }
    try:
        done = subprocess.run(
            command,
            cwd=TREE,
            env=environment,
            capture_output=True,
            check=False,
            timeout=_LONGEST,
        )
    except subprocess.TimeoutExpired:  # it waits for ever: that is noticed, too
        return False
    return done.returncode == 0


def outcome(mutant: Mutant) -> Outcome:
    """Plant a bug, run its tests, and take it away again."""
    path = TREE / mutant.file
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    if text.count(mutant.old) != 1:
        return "NO LONGER APPLIES"
    path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        return "NOT CAUGHT" if passes(mutant.tests) else "caught"
    finally:
        path.write_text(text, encoding="utf-8")


def main(words: list[str]) -> int:
    """Go through the table; return 1 if a bug was not caught or does not apply."""
    rows = mutants(words)
    copy_tree()
    tests = sorted({test for row in rows for test in row.tests})
    if not passes(tests):
        print(f"must be there, and pass before anything is planted: {tests}")
        return 1
    bad = 0
    for number, row in enumerate(rows, 1):
        began = time.perf_counter()
        result = outcome(row)
        bad += result != "caught"
        seconds = time.perf_counter() - began
        print(f"{number:3}/{len(rows)} {result:18} {seconds:5.1f} s  {row.why}", end="")
        print(f"  ({row.file})" if result != "caught" else "", flush=True)
    print(f"{len(rows) - bad} of {len(rows)} caught")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
