"""Deciding while some readings are unknown: they are neither on nor off.

An agent equals a loop over plain sets that never looks at what is unknown, and whatever
stands in its place changes nothing.
"""

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.policy import AgentKind
from neurosnap.agent.policy_kinds import new_policy
from neurosnap.agent.random_draws import RandomNumbers
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.sensorium import Sensorium
from neurosnap.wire import Decision
from tests.support import agent_oracles as agents
from tests.support import oracles
from tests.support.strategies import as_set, bit_rows

if TYPE_CHECKING:
    from neurosnap.poc.learning.snapshot import Snapshot

Row = list[bool | None]
OWN = ["low", "better", "worse"]
SEED, EXPLORE, THRESHOLD = 5, 0.2, 0.25
KINDS = pytest.mark.parametrize("kind", ["walker", "excited", "planner"])
BODY = Body.full(OWN, ["x", "y"], [0, 1, 1])


def agent_of(kind: AgentKind, discounted: bool = False) -> Agent:
    target = ["low*"] if kind == "planner" else []
    policy = new_policy(kind, BODY, SEED, target=target, explore=EXPLORE)
    sensors = Sensorium(BODY.sensors)
    snapshot: Snapshot = EmpiricalSnapshot(sensors, THRESHOLD)
    if discounted:
        snapshot = DiscountedSnapshot(sensors, THRESHOLD / 4, 0.75)
    return Agent(BODY, policy, snapshot)


def act(agent: Agent, row: Row, fill: Sequence[bool], begins: bool) -> Decision:
    """Let it act on a row, with something in the place of what is unknown."""
    bits = [put if on is None else on for on, put in zip(row, fill, strict=True)]
    known = np.array([on is not None for on in row])
    return agent.act(bits, begins, None if None not in row else known)


rows = st.sampled_from(
    [
        list(row)
        for row in itertools.product([True, False, None], repeat=3)
        if any(on is not None for on in row)
    ]
)
fills = bit_rows(3)
walks = st.lists(
    st.tuples(rows, fills, fills, st.integers(0, 7).map(lambda k: k == 7)), max_size=30
)


@pytest.mark.slow
@KINDS
@given(walk=walks, discounted=st.booleans())
def test_no_decision_depends_on_what_is_unknown(
    kind: AgentKind,
    walk: list[tuple[Row, list[bool], list[bool], bool]],
    discounted: bool,
) -> None:
    one, other = (agent_of(kind, discounted) for _ in range(2))
    for row, fill, another, begins in walk:
        assert act(one, row, fill, begins) == act(other, row, another, begins)
        assert (one.state == other.state).all()
    assert one.snapshot.to_bytes() == other.snapshot.to_bytes()


class Loop:
    """An agent by hand, which has None for what it does not know."""

    def __init__(self) -> None:
        self.clock = 0
        self.count: Counter[tuple[int, int]] = Counter()
        self.before: Row = [False] * len(BODY.own)
        self.taken: int | None = None
        self.state: set[int] = set()
        self.edges: oracles.Edges = set()

    def observe(self, row: Row) -> None:
        """Learn from each pair of sensors that are both known, and believe."""
        full = self.sensed(row)
        read = [2 * s + (not on) for s, on in enumerate(full) if on is not None]
        self.clock += 1
        self.count.update(itertools.permutations(read, 2))
        pairs = itertools.permutations(range(len(full)), 2)
        total = {
            (i, j): sum(
                self.count[2 * i + s, 2 * j + t] for s in (0, 1) for t in (0, 1)
            )
            for i, j in pairs
        }
        weights: oracles.Weights = {
            p: self.count[p] for p in oracles.proper_pairs(2 * len(full))
        }
        drawn = oracles.implied(
            2 * len(full), weights, lambda i, j: THRESHOLD * total[i, j]
        ) | oracles.equal(2 * len(full), weights)
        self.edges = {(a, b) for a, b in drawn if self.judged(total[a // 2, b // 2])}
        self.state = oracles.projected(self.edges, read)
        self.before = row

    def judged(self, often: int) -> bool:
        """A pair seldom seen together says nothing."""
        return often > 0 and (2 * often >= self.clock or THRESHOLD * often >= 1)

    def sensed(self, row: Row) -> Row:
        """The whole observation; an action in context that cannot be told is None."""
        on = [bool(each) for each in row]
        full: Row = list(agents.sensed(BODY, on, self.taken, self.state))
        full[: len(row)] = row
        first = len(full) - len(BODY.context)
        for k, (action, literal) in enumerate(BODY.context):
            about = {literal, literal ^ 1} & self.state
            blind = self.before[literal // 2] is None and not about
            if blind and action == self.taken:
                full[first + k] = None
        return full


@pytest.mark.parametrize("share", [0.0, 0.25], ids=["none missing", "some missing"])
@KINDS
def test_an_agent_is_the_loop_by_hand(kind: AgentKind, share: float) -> None:
    agent, loop, draws = agent_of(kind), Loop(), RandomNumbers(SEED)
    chance = np.random.default_rng(3)
    place, change = 1, 0
    reasons, predicted, missing = set(), 0, 0
    for tick in range(1, 81):
        begins = tick == 40
        if begins:
            loop.taken, place, change = None, 0, 0
        seen: Row = [place == 0, change > 0, change < 0]
        row: Row = [None if chance.random() < share else on for on in seen]
        if all(on is None for on in row):
            row[0] = seen[0]
        decision = act(agent, row, [bool(chance.random() < 0.5)] * 3, begins)
        loop.observe(row)
        assert as_set(agent.state) == loop.state
        predicted += any(row[a // 2] is None for a in loop.state if a < 2 * len(row))
        missing += len(loop.state) < len(BODY.sensors)
        pick, often, *_ = draws.at(tick)
        able = {0, 1}
        if kind == "walker":
            options = able
        elif kind == "excited":
            why, options = agents.driven(BODY, loop.edges, loop.state)
            options = able if why == "worse*" and often < EXPLORE else options
        else:
            options = agents.planned(BODY, loop.edges, loop.state, {1})
            options = able if often < EXPLORE else options
        for action in able:
            expected = agents.bound(loop.edges, agents.signal(BODY, action, loop.state))
            assert as_set(agent.consequences(action)) == expected
        loop.taken = sorted(options)[int(pick * len(options))]
        assert (decision.tick, decision.action) == (tick, loop.taken)
        reasons.add(decision.why)
        after = min(2, max(0, place + 1 - 2 * loop.taken))
        place, change = after, after - place
    assert len(reasons) > (1 if kind != "walker" else 0)
    # Or it would say little: some of what was not read is believed, and some is not.
    assert bool(predicted) == (share > 0)
    assert missing or not share
