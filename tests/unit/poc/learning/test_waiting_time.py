"""How long discounted snapshots wait, against snapshots that do.

The paper takes ``w_ab*`` by itself ([GK] discounted:formalism). The other three weights
of the square have a say as well, and truncation moves weight between them:

- To learn: with ``w_ab* = 1`` at first, no implication ``b -> a`` on record meanwhile
  and the other weights above the threshold in time, `to_learn` is exact. While
  ``b -> a`` is on record, each truncation takes what it takes from ``w_a*b`` from
  ``w_ab*`` too, and the wait may be shorter than the paper's ``log tau / log q``.
- To unlearn: ``w_ab*`` is put back to 0 at every step that leaves ``a -> b`` on record,
  so it never gathers. If ``1 - q >= tau``, one observation of ``a b*`` is enough. If
  not, the implication lasts until ``w_a*b`` has run out, which takes
  `to_unlearn` observations: more than ``tau / (1 - q)`` where ``w_a*b`` was large
  enough, and fewer where it was not.

All squares here are of sensors 0 and 1, literals ``a = 0`` and ``b = 2``.
"""

import itertools
import math

import numpy as np
import pytest

from neurosnap.poc.learning.kinds import DiscountedSnapshot
from tools.paper.fig2_discounted import to_learn

A, B = 0, 2
BOTH, ONLY_A, ONLY_B, NEITHER = (1, 1), (1, 0), (0, 1), (0, 0)
SCHEDULE = (BOTH, NEITHER, ONLY_B)

GRID = [(1 - 2.0**-k, tau) for k in (1, 2, 5, 9) for tau in (1 / 8000, 0.01, 0.25)]


def to_unlearn(threshold: float, decay: float, converse: float) -> int:
    """Return how many observations of ``a b*`` in a row end a truncated ``a -> b``.

    With ``1 - q >= tau`` it is 1. Otherwise each such observation adds ``1 - q`` to
    ``w_ab*``, which truncation moves on at the cost of ``w_a*b``; that becomes
    ``(1 + w_a*b) q^k - 1`` and is not larger than ``1 - q`` any more at the least ``k``
    with ``(1 + w_a*b) q^k <= 1``.

    Args:
        threshold: ``tau``, in (0, 1/4].
        decay: ``q`` in (0, 1).
        converse: ``w_a*b`` at first; ``w_ab`` and ``w_a*b*`` must be more than
            ``(1 - q) / q``.
    """
    if 1 - decay >= threshold:
        return 1
    count = max(1, math.floor(-math.log1p(converse) / math.log(decay)) - 1)
    while (1 + converse) * decay**count > 1:
        count += 1
    return count


def square(
    decay: float, tau: float, both: float, only_a: float, only_b: float, code: int
) -> DiscountedSnapshot:
    """A snapshot with these weights, the rest without `a` and `b`."""
    arrays = DiscountedSnapshot(2, tau, decay).arrays()
    return DiscountedSnapshot.from_arrays(
        arrays
        | {
            "clock": np.array(1),
            "joints": np.array([both]),
            "marginals": np.array([both + only_a, both + only_b]),
            "codes": np.array([code], np.uint8),
        }
    )


def largest(decay: float, tau: float) -> DiscountedSnapshot:
    """The square with ``w_ab* = 1``: in it ``a`` and ``b*`` are equivalent."""
    snapshot = square(decay, tau, 0.0, 1.0, 0.0, code=12)
    assert snapshot.weight(A, B ^ 1) == 1
    return snapshot


def recorded(decay: float, tau: float, converse: float) -> DiscountedSnapshot:
    """The square with a truncated ``a -> b``, what is left shared by two weights."""
    rest = (1 - converse) / 2
    snapshot = square(decay, tau, rest, 0.0, converse, code=2)  # sensor 0 is j
    assert snapshot.weight(A, B ^ 1) == 0
    assert has(snapshot, A, B)
    return snapshot


def has(snapshot: DiscountedSnapshot, a: int, b: int) -> bool:
    return bool(snapshot.poc_graph(equivalences=False).edges[a, b])


def quiet(decay: float, tau: float) -> bool:
    """Whether each of `SCHEDULE` keeps its weight above tau: nothing is truncated."""
    return decay**2 * (1 - decay) >= tau


@pytest.mark.parametrize(("decay", "tau"), [g for g in GRID if quiet(*g)])
def test_an_implication_is_learned_after_exactly_so_many_observations(
    decay: float, tau: float
) -> None:
    """The paper's ``log tau / log q`` is needed, and the next whole number enough."""
    snapshot = largest(decay, tau)
    expected = to_learn(tau, decay)
    for count, bits in enumerate(itertools.cycle(SCHEDULE), 1):
        snapshot.learn(bits)
        assert snapshot.weight(A, B ^ 1) == pytest.approx(
            decay**count if count < expected else 0, abs=1e-12
        )
        assert has(snapshot, A, B) == (count == expected)
        if count == expected:
            break
    assert expected - 1 <= math.log(tau) / math.log(decay) < expected


@pytest.mark.parametrize(
    ("decay", "tau", "converse"),
    [
        (decay, tau, converse)
        for (decay, tau), converse in itertools.product(GRID, [0.26, 0.3, 0.5, 0.9])
        # Otherwise the other weights of the square decide.
        if decay * (1 - converse) / 2 > 1 - decay or 1 - decay >= tau
    ],
)
def test_an_implication_lasts_exactly_so_many_observations_against_it(
    decay: float, tau: float, converse: float
) -> None:
    """Counts are held against the paper's necessary ``tau / (1 - q)`` as well.

    They exceed it where a step weighs more than tau, and where the converse is heavy
    enough. At equality the paper's strict sign is loose: with ``tau = 1 - q`` one
    observation is enough, since an implication needs a weight below tau.
    """
    snapshot = recorded(decay, tau, converse)
    expected = to_unlearn(tau, decay, converse)
    for count in range(1, expected + 1):
        assert has(snapshot, A, B)
        snapshot.learn(ONLY_A)
        # What is on record is truncated at every step: it does not gather.
        if count < expected:
            assert snapshot.weight(A, B ^ 1) == pytest.approx(0, abs=1e-12)
            left = (1 + converse) * decay**count - 1
            assert snapshot.weight(A ^ 1, B) == pytest.approx(left)
    assert not has(snapshot, A, B)
    bound = tau / (1 - decay)
    if 1 - decay == tau:
        assert expected == bound == 1
    elif 1 - decay > tau or math.log1p(converse) > -math.log(decay) * bound:
        assert expected > bound
