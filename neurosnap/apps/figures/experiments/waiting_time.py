"""How long a discounted snapshot takes to learn and to drop an implication.

The paper takes ``w_ab*`` by itself ([GK] discounted:formalism). The other three weights
of the square have a say as well, and truncation moves weight between them:

- To learn: with ``w_ab* = 1`` at first, no implication ``b -> a`` on record meanwhile
  and the other weights above the threshold in time, `to_learn` is exact. While
  ``b -> a`` is on record, each truncation takes what it takes from ``w_a*b`` from
  ``w_ab*`` too, and the wait may be shorter.
- To unlearn: ``w_ab*`` is put back to 0 at every step that leaves ``a -> b`` on record,
  so it never gathers. If ``1 - q >= tau``, one observation of ``a b*`` is enough. If
  not, the implication lasts until ``w_a*b`` has run out, which takes
  `to_unlearn` observations: more than ``tau / (1 - q)`` where ``w_a*b`` was large
  enough, and fewer where it was not.
"""

import math


def to_learn(threshold: float, decay: float, weight: float = 1.0) -> int:
    """Return after how many observations without ``a b*`` its weight is below `tau`.

    The least ``k`` with ``q^k w < tau``: the paper's ``k > log tau / log q`` for a
    weight of 1.

    Args:
        threshold: ``tau``, in (0, 1/4].
        decay: ``q`` in (0, 1).
        weight: ``w_ab*`` at first, in [0, 1]; a new snapshot has 1/4.
    """
    if weight < threshold:
        return 0
    # The logarithms land next to the answer; the powers themselves decide.
    count = max(0, math.floor(math.log(threshold / weight) / math.log(decay)) - 1)
    while decay**count * weight >= threshold:
        count += 1
    return count


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
