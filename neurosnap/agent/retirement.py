"""Decides which grown sensors retire because others make them redundant.

What it guarantees of the world's own sensors, a part of its context guarantees as well.
Or each of these was guaranteed, whenever it was on, by some other sensor that was on,
too: so several wide contexts take the place of a narrow one that came first. If they do
not where the agent has not been yet, that is a surprise, and it is grown again.
"""

import numpy as np

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import PocGraph


def is_needless(body: Body, place: int, snapshot: Snapshot) -> Search[bool]:
    """Tell whether a grown sensor, by its place among these, is to retire.

    It costs some `PocGraph.up`, and rings of the history.
    """
    graph = snapshot.poc_graph()
    alone = _guarantees_alone(body, place, graph)
    if alone:
        alone = yield from _not_covered(body, place, alone, graph, snapshot)
    return not alone


def _guarantees_alone(body: Body, place: int, graph: PocGraph) -> list[int]:
    """Return what a grown sensor guarantees that no part of its context does."""
    action, literals = body.grown[place]
    first = 2 * body.first_grown
    part = body.members(body.grown[place])
    for other, (which, fewer) in enumerate(body.grown):
        smaller = which == action and set(fewer) < set(literals)
        if smaller and other not in body.retired:
            part.append(first + 2 * other)
    closures = graph.up([first + 2 * place]), graph.up(part)
    whole, rest = guaranteed(closures)[:, : 2 * len(body.own)]
    return np.flatnonzero(whole & ~rest).tolist()


def _not_covered(
    body: Body,
    place: int,
    results: list[int],
    graph: PocGraph,
    snapshot: Snapshot,
) -> Search[list[int]]:
    """Return which results of a sensor others did not always guarantee when it was on.

    The snapshot has counted how often the sensor was on.
    """
    mine = 2 * (body.first_grown + place)
    actions = Actions(body)
    may_be_on = actions.signal(body.grown[place][0], actions.in_use)
    others = [a for a in may_be_on if a != mine]
    by: dict[int, list[int]] = {}
    for result in results:
        # a -> r if and only if r* -> a*
        less, more = graph.up([result ^ 1]), graph.up([result])
        by[result] = [a for a in others if less[a ^ 1] and not more[a ^ 1]]
    if not all(by.values()):
        return results
    asked = dict.fromkeys([mine, *(a for many in by.values() for a in many)])
    read = (yield Question(readings=tuple(asked))).readings
    was_on = read[mine]
    remembered = int(np.bitwise_count(was_on).sum())
    if not remembered:
        return results
    # Where it has not been for longer than the history is, others may be missing:
    # the sensor would retire, be missed, and be grown again, time and again.
    # (Shares of a discounted snapshot are at most 1: it forgets such times, too.)
    result = results[0]
    counted = snapshot.weight(mine, result) + snapshot.weight(mine, result ^ 1)
    if counted > remembered:
        return results
    return [
        result
        for result, many in by.items()
        if (was_on & ~np.bitwise_or.reduce([read[a] for a in many])).any()
    ]
