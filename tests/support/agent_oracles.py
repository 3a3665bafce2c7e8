"""A reference agent, written with plain loops and sets.

Nothing here uses the code under test but `Body`, as a record of who has which sensors,
and `PocGraph`, to hand relations over. Literals are ints, a relation is the set of its
edges.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.poc.order.graph import PocGraph
from tests.support.oracles import Edges, holds, reach, stars

Moves = Sequence[Sequence[int]]
Fields = Sequence[Sequence[bool]]


def sensed(
    body: Body, bits: Sequence[bool], taken: int | None, state: set[int]
) -> list[bool]:
    """The observation after `taken` in `state`, or None if nothing went before."""
    felt = [action == taken for action in range(len(body.actions))]
    return [
        *bits,
        *(felt if body.senses_actions else []),
        *(action == taken and literal in state for action, literal in body.context),
    ]


def complete(bits: Sequence[bool]) -> set[int]:
    """An observation as a complete *-selection."""
    return {a for a in range(2 * len(bits)) if holds(list(bits), a)}


def view(fields: Fields, place: int) -> list[bool]:
    """What the world's sensors read at a place."""
    return [field[place] for field in fields]


def happens(
    body: Body, moves: Moves, fields: Fields, place: int, action: int
) -> set[int]:
    """All that is sensed after an action taken at a place."""
    after = view(fields, moves[action][place])
    before = complete(view(fields, place))
    return complete(sensed(body, after, action, before))


def truth(body: Body, seen: Iterable[set[int]]) -> Edges:
    """``a -> b`` iff `b` is on wherever `a` is."""
    seen, n = list(seen), 2 * len(body.sensors)
    return {
        (a, b)
        for a in range(n)
        for b in range(n)
        if a != b and all(b in selection for selection in seen if a in selection)
    }


def everywhere(body: Body, moves: Moves, fields: Fields) -> Edges:
    """What is true of every action at every place."""
    return truth(
        body,
        (
            happens(body, moves, fields, place, action)
            for action in range(len(moves))
            for place in range(len(moves[action]))
        ),
    )


def signal(body: Body, taken: int, state: set[int]) -> set[int]:
    """What an action taken in a state switches on."""
    first = len(body.own) + len(body.actions)
    return {2 * (len(body.own) + taken)} | {
        2 * (first + place)
        for place, (action, literal) in enumerate(body.context)
        if action == taken and literal in state
    }


def bound(edges: Edges, switched_on: set[int]) -> set[int]:
    """What follows and is not contradicted."""
    above = reach(edges, switched_on)
    return above - stars(above)


def position(body: Body) -> set[int]:
    """The literals of the world's state sensors."""
    orders = body.orders or (0,) * len(body.own)
    return {a for a in range(2 * len(body.own)) if orders[a // 2] == 0}


def plan(edges: Edges, state: set[int], target: set[int]) -> set[int]:
    """The reduced target propagated over the graph loaded with the state."""
    above = reach(edges, target)
    reduced = above - stars(above)
    return {a for a in reach(edges, state | reduced) if a ^ 1 not in reduced}


def planned(body: Body, edges: Edges, state: set[int], target: set[int]) -> set[int]:
    """The actions that guarantee most of the plan, in the place and of the target."""
    above = reach(edges, target)
    sought = target - stars(above)
    wanted = plan(edges, state, target) & (position(body) | sought)
    score = {
        action: len(bound(edges, signal(body, action, state)) & wanted)
        for action in range(len(body.actions))
    }
    return {number for number in score if score[number] == max(score.values())}


def driven(body: Body, edges: Edges, state: set[int]) -> tuple[str, set[int]]:
    """What an excitation-driven agent goes by, and the actions it then has."""
    better = 2 * body.own.index("better")
    not_worse = 2 * body.own.index("worse") + 1
    able = set(range(len(body.actions)))
    for why, wanted in (("better", better), ("worse*", not_worse)):
        found = {
            action
            for action in able
            if wanted in bound(edges, signal(body, action, state))
        }
        if found:
            return why, found
    return "nothing", able


def as_array(literals: set[int], sensors: int) -> NDArray[np.bool_]:
    """A set of literals as the code under test wants it."""
    on = np.zeros(2 * sensors, np.bool_)
    on[list(literals)] = True
    return on


def known(body: Body, moves: Moves, fields: Fields) -> PocGraph:
    """The true relation, by looking at every action at every place."""
    edges = everywhere(body, moves, fields)
    return PocGraph.from_implications(len(body.sensors), edges)
