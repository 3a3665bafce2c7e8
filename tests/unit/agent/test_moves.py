"""Moves counted in past readings are held against a loop."""

import numpy as np

from neurosnap.agent.clones import walk_in
from neurosnap.agent.moves import moves_in
from neurosnap.poc.learning.reading_history import History


def test_moves_are_what_was_read_before_and_after_one_action() -> None:
    history = History(5, 64)

    def show(own: list[int], action: int = -1, known: bool = True) -> None:
        bits = np.array([*own, action == 0, action == 1], np.bool_)
        history.record(bits, np.arange(5) >= 1 - known, action < 0)

    told = list[tuple[list[int], int, list[int]]]()
    rng, before = np.random.default_rng(0), [0, 0, 0]
    show(before)
    sure = [True]
    for _ in range(100):  # it comes round: the oldest are gone
        after, action = rng.integers(2, size=3).tolist(), int(rng.integers(-1, 2))
        known = bool(rng.random() < 0.8)
        show(after, action, known)
        told.append((before, action, after))
        before = after
        sure.append(known)
    lost = len(told) + 1 - 64  # moves of which what was read before is gone
    wanted = [
        move
        for move, *known in zip(
            told[lost:], sure[lost:-1], sure[lost + 1 :], strict=True
        )
        if move[1] >= 0 and all(known)
    ]
    read = {a: history.ticks_of(a) for a in range(10)}
    found = moves_in(walk_in(read, range(3), [6, 8], history.tick))
    assert len(wanted) > 10
    rows = zip(
        found.before.astype(int).tolist(),
        found.action.tolist(),
        found.after.astype(int).tolist(),
        strict=True,
    )
    assert list(rows) == wanted
