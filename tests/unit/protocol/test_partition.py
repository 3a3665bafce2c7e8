"""Cells are shared out evenly, each to one worker."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.protocol.partition import hosts, shares


@given(st.integers(1, 60).flatmap(lambda n: st.tuples(st.just(n), st.integers(1, n))))
def test_every_cell_has_one_worker_and_no_worker_has_much_more(
    sizes: tuple[int, int],
) -> None:
    cells, workers = sizes
    hosted = shares(cells, workers)
    assert len(hosted) == workers
    assert [cell for share in hosted for cell in share] == list(range(cells))
    counts = [len(share) for share in hosted]
    assert max(counts) - min(counts) <= 1
    assert counts == sorted(counts, reverse=True)


@pytest.mark.parametrize("workers", [-1, 0, 4])
def test_a_worker_without_a_cell_is_refused(workers: int) -> None:
    expected = rf"^workers: must be at least 1 and at most the cells, 3, got {workers}$"
    with pytest.raises(InvalidValueError, match=expected):
        shares(3, workers)


def test_parts_are_named_by_what_they_are() -> None:
    assert hosts(3, 0) == ["cell/0", "cell/1", "cell/2"]
    assert hosts(3, 2) == ["worker/0", "worker/1"]
