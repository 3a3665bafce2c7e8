"""Chooses the action to explore: the one expected to surprise most per step.

While states are imagined, nearest first, each outcome is put down as unknown or known.
An unknown one is a sure surprise. Of a known one that was never seen, and of a new
episode, `Experience.hope` tells how likely it is. What gives most surprises a step is
chosen.

References:
    Not the paper's. To go where an outcome is unknown is the exploration of R-max
    (Brafman & Tennenholtz 2002). Of its table there is which action was taken where,
    and that serves only to test what seems to be known: where most surprises are to be
    expected (Schmidhuber 1991, "Curious model-building control systems").
"""

from neurosnap.agent.experience import BEGINNING, Experience
from neurosnap.agent.plan import ImaginedState

Trial = tuple[ImaginedState, int, str]
"""Where, the action to take there, and how the reason for it begins."""


class Curiosity:
    """Chooses which action to try, and in which of the states imagined so far.

    Args:
        experience: What was met so far.
        actions: Their names.
        aims: Whether there is a target. Then only unknown outcomes are gone for, as one
            of them may lead there.
    """

    def __init__(
        self, experience: Experience, actions: tuple[str, ...], aims: bool
    ) -> None:
        self._experience = experience
        self._names = actions
        self._aims = aims
        self._best: list[Trial] = []
        self._hope = 0.0  # surprises a step
        self._seen: list[Trial] = []
        self._end: tuple[ImaginedState, int] | None = None  # the nearest, and by what

    def unknown(self, state: ImaginedState, action: int) -> None:
        """Put down an action whose outcome is unknown."""
        why = f"to learn what {self._names[action]} does there, "
        self._weigh((state, action, why), 1.0)

    def known(self, state: ImaginedState, action: int) -> None:
        """Put down an action whose outcome seems to be known."""
        if self._aims:
            return
        told = self._experience
        trial = state, action, f"to test what {self._names[action]} does there, "
        if (told.key(state.place), action) in told.tried:
            self._seen.append(trial)
        else:
            self._weigh(trial, told.hope(action))

    def end(self, state: ImaginedState, action: int = -1) -> None:
        """Put down a state at which an episode ends; -1: whatever is done."""
        self._end = self._end or (state, action)

    def is_settled(self, steps: int) -> bool:
        """Return whether no trial at this distance or beyond can be better."""
        return not self._aims and self._hope >= 1 / (steps + 1)

    def choice(self, draw: float) -> Trial | None:
        """Return what to try, by a number in [0, 1) that decides between equals.

        Returns:
            An action somewhere; None if there is nothing to learn.
        """
        best = self._best or self._seen
        if self._end is not None and not self._aims:
            end, by = self._end
            action = by if by >= 0 else int(draw * len(self._names))
            another = end, action, "to begin another episode, "
            if self._is_better_to_begin(end):
                return another
            if not self._best:  # all was seen: see any of it again, every other time
                half, draw = divmod(2 * draw, 1.0)
                best = [another] if half else self._seen
        return best[int(draw * len(best))] if best else None

    def _is_better_to_begin(self, end: ImaginedState) -> bool:
        """Return whether another episode is better than anything to be tried."""
        hope = self._experience.hope(BEGINNING) / (end.steps + 1)
        return 0 < self._hope < hope

    def _weigh(self, trial: Trial, share: float) -> None:
        """Keep a trial if none is better. Those of equal worth are kept alike."""
        hope = share / (trial[0].steps + 1)
        if hope > self._hope:
            self._best, self._hope = [], hope
        if hope == self._hope:
            self._best.append(trial)
