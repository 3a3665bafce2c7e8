"""The policies by name, and what goes with which."""

from typing import Any

import numpy as np
import pytest

from neurosnap.agent.body import Body
from neurosnap.agent.planner import Planner
from neurosnap.agent.policies import Excited, Walker, new_policy
from neurosnap.agent.policy import AgentKind
from neurosnap.errors import InvalidValueError
from tests.support.deliberations import decided

BODY = Body.full(["a", "b"], ["x", "y"])


def test_each_is_had_by_its_name() -> None:
    body = Body.full(["a", "better", "worse"], ["x"], [0, 1, 1])
    assert isinstance(new_policy("walker", body, 0), Walker)
    assert isinstance(new_policy("excited", body, 0), Excited)
    assert isinstance(new_policy("planner", body, 0, target=["a"]), Planner)


@pytest.mark.parametrize("kind", ["walker", "excited"])
def test_only_a_planner_has_a_target(kind: AgentKind) -> None:
    with pytest.raises(
        InvalidValueError,
        match=r"^target: must go with a planner (only|or an excited agent), got \('a',\)",
    ):
        new_policy(kind, BODY, 0, target=["a"])


def test_a_planner_needs_one() -> None:
    with pytest.raises(InvalidValueError, match=r"^target: must name a sensation"):
        new_policy("planner", BODY, 0)


def test_a_walker_chooses_among_all_choices() -> None:
    body = Body.full(["a"], ["x", "y"], exclusive=False)
    policy = new_policy("walker", body, 1)
    nothing = np.zeros(2 * len(body.sensors), np.bool_)
    taken = {decided(policy, tick, nothing, [])[0] for tick in range(60)}
    assert taken == {0, 1, 2, 3}


@pytest.mark.parametrize("kind", ["walker", "excited", "planner"])
def test_only_who_imagines_plans_where_to_explore(kind: AgentKind) -> None:
    body = Body.full(["a", "better", "worse"], ["x", "y"], [0, 1, 1])
    given: dict[str, Any] = {"target": ["a"]} if kind == "planner" else {}
    rule = r"^explore: must go with a planner that imagines .*, got 'planned'"
    with pytest.raises(InvalidValueError, match=rule):
        new_policy(kind, body, 0, explore="planned", **given)


@pytest.mark.parametrize("kind", ["excited", "planner"])
def test_the_share_of_random_actions_is_passed_on(kind: AgentKind) -> None:
    body = Body.full(["a", "better", "worse"], ["x", "y"], [0, 1, 1])
    target = ["a"] if kind == "planner" else []
    nothing = np.zeros(2 * len(body.sensors), np.bool_)
    # x guarantees worse* and a, y nothing.
    x = nothing.copy()
    x[[0, 5]] = True
    wanted = nothing.copy()
    wanted[0] = True
    answers = [x, nothing, wanted] if kind == "planner" else [x, nothing]
    for explore, taken in ((0.0, {0}), (1.0, {0, 1})):
        policy = new_policy(kind, body, 0, target=target, explore=explore)
        found = {decided(policy, tick, nothing, answers)[0] for tick in range(40)}
        assert found == taken
