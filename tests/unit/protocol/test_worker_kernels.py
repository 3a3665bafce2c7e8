"""How a worker splits credit, and adds up what comes back."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.protocol.wave import split_evenly
from neurosnap.protocol.worker_kernels import carried, split
from tests.support.wave_messages import share


@given(st.integers(0, 10_000), st.integers(1, 3000))
def test_credit_is_split_as_a_cell_splits_it(credit: int, parts: int) -> None:
    larger, exponent = split(credit, parts)
    shares_ = [exponent - (number < larger) for number in range(parts)]
    assert shares_ == split_evenly(credit, parts)


@given(st.lists(st.integers(0, 90), min_size=1, max_size=60), st.integers(1, 40))
def test_shares_are_added_up_until_each_comes_once(
    exponents: list[int], room: int
) -> None:
    least = min(exponents)
    back = np.bincount(np.array(exponents) - least, minlength=room).astype(np.int64)
    total = sum(map(share, exponents))
    left = carried(back, least)
    assert list(left) == sorted(left)
    if total <= 1:
        assert sum(map(share, left)) == total
        assert len(set(left)) == len(left)
    else:  # no wave has so much, and what is said cannot be taken for less
        assert sum(map(share, left)) > 1
