"""All notebooks run, and their output equals the stored output."""

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def printed(cells: list[dict[str, Any]]) -> list[str]:
    """Run cells in one namespace; return what each prints."""
    names: dict[str, object] = {"__name__": "__main__"}
    found = []
    for number, cell in enumerate(cells, start=1):
        source = compile("".join(cell["source"]), f"cell {number}", "exec")
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(source, names)
        found.append(out.getvalue())
    return found


def stored(cell: dict[str, Any]) -> str:
    """Return what a notebook has of a cell's output."""
    return "".join(line for output in cell["outputs"] for line in output["text"])


@pytest.mark.parametrize("name", ["your_own_data", "an_agent", "a_plant"])
def test_a_notebook_prints_what_it_shows(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.syspath_prepend(EXAMPLES)  # as Jupyter does
    every = json.loads((EXAMPLES / f"{name}.ipynb").read_text())["cells"]
    cells = [cell for cell in every if cell["cell_type"] == "code"]
    assert printed(cells) == [stored(cell) for cell in cells]
    assert sum(1 for cell in cells if cell["outputs"]) >= 5
