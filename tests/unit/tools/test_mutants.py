"""The table of planted bugs matches the current source."""

import pytest

from tools.mutants.__main__ import HERE, Mutant, mutants

ROWS = mutants([])


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.why)
def test_a_row_fits_the_source(row: Mutant) -> None:
    assert (HERE / row.file).read_text(encoding="utf-8").count(row.old) == 1
    assert row.new != row.old
    assert all((HERE / test.partition("::")[0]).exists() for test in row.tests)
