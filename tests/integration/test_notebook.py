"""The notebooks run from top to bottom, and print what they show."""

from pathlib import Path

import pytest

from tests.support.notebooks import code_cells, printed, stored

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("name", ["your_own_data", "an_agent"])
def test_a_notebook_prints_what_it_shows(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(EXAMPLES)
    cells = code_cells(EXAMPLES / f"{name}.ipynb")
    assert printed(cells) == [stored(cell) for cell in cells]
    assert sum(1 for cell in cells if cell["outputs"]) >= 5
