"""The examples in docstrings run as they are printed."""

import doctest
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def examples() -> dict[str, int]:
    """Return how many examples a module has, of those that have any.

    By their text: no module is imported for nothing, and an example that doctest does
    not come to, such as one of compiled code, is missed.
    """
    found = {}
    for package in ("neurosnap", "world"):
        for path in sorted((ROOT / package).rglob("*.py")):
            count = len(re.findall(r"^ *>>> ", path.read_text(), re.MULTILINE))
            if count:
                parts = path.relative_to(ROOT).with_suffix("").parts
                found[".".join(parts).removesuffix(".__init__")] = count
    return found


EXAMPLES = examples()


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run_as_printed(name: str) -> None:
    said: list[str] = []
    runner = doctest.DocTestRunner()
    for test in doctest.DocTestFinder().find(importlib.import_module(name), name):
        runner.run(test, out=said.append)
    assert not runner.failures, "".join(said)
    assert runner.tries == EXAMPLES[name]
