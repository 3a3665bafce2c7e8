"""The check of a claim passes on data that agree with it, and fails on others."""

from collections.abc import Callable, Sequence

import msgspec
import numpy as np
import pytest

from tools.paper import fig1_empirical, fig2_discounted, learners
from tools.paper.curves import Curve
from tools.paper.fig2_discounted import to_learn
from tools.paper.figure import Claim, FigureOptions, judged
from tools.paper.learning_error import LearningEntry
from tools.paper.walks import SETTINGS

pytestmark = pytest.mark.slow
STEPS = 24_000  # all decays have learned long before the last tenth
OPTIONS = FigureOptions(runs=2, steps=STEPS)
SLOW, FAST = 400.0, 100.0


def curve(cell: LearningEntry, *, half: float = FAST, level: float = 0) -> Curve:
    """One that falls from 400 edges by halves, and to a level."""
    errors = (400 - level) * 2.0 ** (-np.arange(STEPS) / half) + level
    return Curve(cell, np.stack([errors.round().astype(np.uint16)] * 2))


def as_the_paper_has_it(cell: LearningEntry) -> Curve:
    """An empirical learner that does all the paper says, with critical τ of 0.04."""
    high = cell.threshold > 0.04
    match cell.setting:
        case "path":
            return curve(cell, half=SLOW)
        case "cycle":
            return curve(cell, half=FAST, level=30 if high else 8)
        case "grid":
            return curve(cell, half=FAST)
        case _:
            return curve(cell, half=2 * SLOW, level=50 if high else 0)


def by_setting(curves: Sequence[Curve]) -> dict[str, list[Curve]]:
    return {
        name: [curve for curve in curves if curve.cell.setting == name]
        for name in SETTINGS
    }


Shape = Callable[[LearningEntry], Curve]


def empirical_claims(
    shape: Shape, options: FigureOptions = OPTIONS
) -> list[tuple[str, bool]]:
    cells = learners.learners(options, discounted=False)
    claims = fig1_empirical.claims(options, by_setting([shape(c) for c in cells]))
    return [(claim.says, claim.holds is True) for claim in claims]


def holds(found: Sequence[tuple[str, bool]], begins: str) -> bool:
    (answer,) = [held for says, held in found if says.startswith(begins)]
    return answer


def instead(setting: str, **shape: float) -> Shape:
    """The paper's curves but for one setting."""
    return lambda cell: (
        curve(cell, **shape) if cell.setting == setting else as_the_paper_has_it(cell)
    )


def test_claims_hold_where_the_data_are_as_the_paper_says() -> None:
    found = empirical_claims(as_the_paper_has_it)
    assert holds(found, "(b) and (c) decline more sharply")
    assert holds(found, "(d) lags")
    assert holds(found, "(a) learns exponentially")
    assert holds(found, "in (c) x and y cross")
    assert holds(found, "the behaviour of (c)")
    assert holds(found, "sub-critical")


@pytest.mark.parametrize(
    ("begins", "shape"),
    [
        ("(b) and (c) decline more sharply", instead("cycle", half=2 * SLOW)),
        ("(b) and (c) decline more sharply", instead("grid", level=300)),
        ("(d) lags", instead("random", half=FAST)),
        ("(d) lags", instead("random", half=SLOW / 2)),  # only the path is slower
        ("(a) learns exponentially", instead("path", level=2)),
        ("for large τ", instead("cycle")),
        ("for large τ", instead("random", half=4000)),
        ("for small enough τ", instead("cycle", level=2)),
        ("the critical τ", instead("cycle")),
        ("the behaviour of (c)", instead("grid", level=2)),
        ("sub-critical", instead("cycle")),
        ("sub-critical", instead("random", level=2)),
    ],
)
def test_a_claim_does_not_hold_where_the_data_say_otherwise(
    begins: str, shape: Shape
) -> None:
    assert not holds(empirical_claims(shape), begins)


def test_the_two_modes_and_their_critical_threshold_are_found() -> None:
    def two_modes(cell: LearningEntry) -> Curve:
        # Between the second threshold and the third lie 1/20 and 1/21, and between
        # the first and the second 1/121.
        critical = 0.01 if cell.setting == "grid" else 0.04
        return curve(cell, level=30 if cell.threshold > critical else 0)

    found = empirical_claims(two_modes)
    for begins in ("for large τ", "for small enough τ", "the critical τ"):
        assert holds(found, begins)
    late = empirical_claims(lambda c: curve(c, level=30 if c.threshold > 0.2 else 0))
    assert holds(late, "for large τ")
    assert not holds(late, "the critical τ")


def test_of_the_thresholded_truth_only_convergence_is_claimed() -> None:
    options = msgspec.structs.replace(OPTIONS, truth="thresholded")
    ((says, held),) = empirical_claims(curve, options)
    assert held
    assert says.startswith("Err(t) converges to zero at an exponential rate")
    ((_, held),) = empirical_claims(instead("cycle", level=2), options)
    assert not held


def discounted_claims(
    levels: Sequence[float], waits: Sequence[int] | None = None
) -> list[tuple[str, bool]]:
    """Of curves at 400 until their wait is over, then at their level."""

    def shape(cell: LearningEntry, level: float, wait: int) -> Curve:
        rows = np.full((2, STEPS), 400, np.uint16)
        rows[:, wait:] = level
        return Curve(cell, rows)

    first = [to_learn(learners.LEAST, q) for q in learners.DECAYS]
    pairs = list(zip(levels, waits or first, strict=True)) * 4
    cells = learners.learners(OPTIONS, discounted=True)
    curves = [shape(cell, *pair) for cell, pair in zip(cells, pairs, strict=True)]
    claims = fig2_discounted.claims(by_setting(curves))
    return [(claim.says, claim.holds is True) for claim in claims]


BEST_AT_5 = [90, 80, 70, 60, 20, 10, 30, 40, 50, 60]


def test_discounted_claims_hold_where_the_data_are_as_the_paper_says() -> None:
    assert [held for _, held in discounted_claims(BEST_AT_5)] == [True] * 4


@pytest.mark.parametrize(
    ("begins", "levels", "waits"),
    [
        ("learning does not depend", list(range(90, -10, -10)), None),
        ("k = 5 works best", [*BEST_AT_5[:9], 9], None),
        ("k = 4 waits less", BEST_AT_5, [9000] * 5 + [8000] * 5),
        ("nothing goes on record", BEST_AT_5, [20] * 10),
    ],
)
def test_a_discounted_claim_does_not_hold_where_the_data_say_otherwise(
    begins: str, levels: list[float], waits: list[int] | None
) -> None:
    assert not holds(discounted_claims(levels, waits), begins)


def test_too_few_steps_decide_nothing() -> None:
    long, any_length = Claim("slow", False, "1"), Claim("plain", True, "2", steps=0)
    few = judged((long, any_length), 7999)
    assert [claim.holds for claim in few] == [None, True]
    assert few[0].verdict == "too few steps to judge (it takes 8,000)"
    assert judged((long, any_length), 8000) == (long, any_length)
