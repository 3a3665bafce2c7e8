"""Shares of credit: nothing is lost when one is split."""

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from neurosnap.protocol.credit import split_evenly


@given(credit=st.integers(0, 10_000), parts=st.integers(1, 300))
def test_split_shares_add_up_to_the_whole(credit: int, parts: int) -> None:
    shares = split_evenly(credit, parts)
    assert len(shares) == parts
    assert sum(Fraction(1, 2**share) for share in shares) == Fraction(1, 2**credit)
    assert shares == sorted(shares)
    assert shares[-1] - shares[0] <= 1
