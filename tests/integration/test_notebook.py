"""The notebook runs from top to bottom, and prints what it shows."""

from pathlib import Path

import pytest

from tests.support.notebooks import code_cells, printed, stored

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_the_notebook_prints_what_it_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)
    cells = code_cells(EXAMPLES / "your_own_data.ipynb")
    assert printed(cells) == [stored(cell) for cell in cells]
    assert sum(1 for cell in cells if cell["outputs"]) >= 5
