"""A question to several parts is repeated until all answer, or given up."""

import pytest

from neurosnap.errors import AnswerLostError
from neurosnap.protocol.ask_until_answered import Round


@pytest.mark.parametrize("spare", [0, 1])
def test_it_is_asked_again_as_often_as_allowed(spare: int) -> None:
    asked: Round[int] = Round("question 1", 1)
    for _ in range(1 + spare):
        asked.ask_again(["cell/0"], spare=spare)
    what = f"^question 1: must be answered .*, got {2 + spare} tries; silent: cell/0$"
    with pytest.raises(AnswerLostError, match=what):
        asked.ask_again(["cell/0"], spare=spare)


@pytest.mark.parametrize(
    ("count", "named"),
    [(0, "none$"), (10, "cell/9$"), (12, "cell/9 and 2 more$")],
)
def test_ten_are_named(count: int, named: str) -> None:
    asked: Round[int] = Round("wave 1", 0)
    with pytest.raises(AnswerLostError, match=named):
        asked.ask_again([f"cell/{k}" for k in range(count)], rule="settle")
