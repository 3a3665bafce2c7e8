"""Available actions and their guaranteed effects."""

import pytest

from neurosnap.agent.actions import Actions
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError


@pytest.mark.parametrize(
    "body",
    [
        Body(own=("a",)),
        Body(own=("a",), senses_actions=True),
        Body(own=("a",), actions=("go",), context=((0, 0),)),
    ],
)
def test_a_body_must_sense_what_it_does(body: Body) -> None:
    with pytest.raises(
        InvalidValueError, match=r"^agent: must have actions that are sensors, got "
    ):
        Actions(body)
