"""Evidence for and against an implication, as weights."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Evidence:
    """The square of an implication ``a -> b``, as it stands now.

    Weights are whole numbers of observations in an empirical snapshot, and shares of
    1 in a discounted one ([GK] eqn:virtual implication).
    """

    total: float
    """What the four weights add up to: how often both sensors were known; or 1."""
    both: float
    """``w_ab``: for it."""
    neither: float
    """``w_a*b*``: for it."""
    other: float
    """``w_a*b``: neither for nor against it; what it leaves open."""
    against: float
    """``w_ab*``: against it."""
    limit: float
    """``tau total``: what the weight against it must be less than."""
    holds: bool
    """Whether ``a -> b`` is an edge of the derived graph, equivalences included."""
    since: int
    """The observation at which what relates the two sensors last changed, from 1; 0 if
    it never did. Those that were skipped count.

    That is when it began to hold, or no longer did, unless an implication became an
    equivalence or the other way round, which is a change too. Also 0 if it changed
    before the snapshot was saved by a version that kept no account of this.
    """
