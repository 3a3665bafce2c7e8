"""Generated pages are up to date with the code."""

import pytest

from tools import reference


@pytest.mark.parametrize("name", sorted(reference.MADE))
def test_a_page_is_what_the_code_says(name: str) -> None:
    written = (reference.PAGES / name).read_text(encoding="utf-8")
    assert written == reference.MADE[name](), "run tools/reference.py"


@pytest.mark.parametrize("name", sorted(reference.MADE))
def test_no_code_in_a_table_has_a_bar(name: str) -> None:
    """Some programs show it with the stroke before it, others need that."""
    for line in reference.MADE[name]().splitlines():
        if line.startswith("|"):
            assert "|" not in "".join(line.split("`")[1::2]), line
