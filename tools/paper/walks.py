"""The paper's four settings, random walks in them, and their true relations.

A walk is a function of the seed, the setting and the number of the run. All learners
are shown the same walks, so what differs between them is not luck.

What is true is given as a code a pair of sensors, with the bits of
`neurosnap.poc.learning.pairs`. As a truth may hold any of the four bits at once
(an empty field lies within everything), its codes are sets of implications and nothing
more.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import gymnasium
import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.poc.dual.realization import inclusions
from neurosnap.sources.gymnasium_source import import_worlds

_SLACK = 1e-12
"""By how much a probability must be smaller: sums of equal shares tie, and round."""


class Setting(msgspec.Struct, frozen=True):
    """One of the paper's environments ([GK] settings (a) to (d))."""

    name: str
    """What it is called in the data."""
    letter: str
    """What the paper calls it."""
    world: str
    """The environment's id."""


SETTINGS = {
    setting.name: setting
    for setting in (
        Setting("path", "a", "neurosnap/Path-v0"),
        Setting("cycle", "b", "neurosnap/Cycle-v0"),
        Setting("grid", "c", "neurosnap/Grid-v0"),
        Setting("random", "d", "neurosnap/RandomFields-v0"),
    )
}
"""Each has 20 sensors. Their order goes into the seed of every walk: add last."""


@dataclass(frozen=True)
class World:
    """A world of places: where actions lead, and what is sensed there."""

    body: Body
    moves: NDArray[np.intp]
    """``(actions, places)``; where an action leads from a place."""
    fields: NDArray[np.bool_]
    """``(N, places)``; where each state sensor is on."""
    place: int
    """Where one begins."""
    distances: NDArray[np.float64]
    """``(places,)``; to the target, in actions; empty if it has no target."""
    coordinates: NDArray[np.intp]
    """``(places, 2)``, of a grid; else empty."""

    def sense(
        self, after: int | NDArray[np.intp], before: int | NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return what is read after a step, ``(N,)``, or after some, ``(N, steps)``."""
        own = self.fields[:, after]
        if not len(self.distances):
            return own
        near, far = self.distances[after], self.distances[before]
        return np.concatenate([own, [near < far], [near > far]])


def world_of(
    name: str, seed: int | None = None, target: int | str | None = None
) -> World:
    """Return a world as a table.

    Args:
        name: The environment's id.
        seed: Draws what there is to draw in it.
        target: The place to get to, or ``drawn``; None if there is none.
    """
    import_worlds()
    arguments: dict[str, Any] = {} if target is None else {"target": target}
    env: gymnasium.Env[Any, Any] = gymnasium.make(name, **arguments)
    try:
        _, info = env.reset(seed=seed)
        get, has = env.get_wrapper_attr, env.has_wrapper_attr
        return World(
            body=Body.full(get("sensors"), get("actions"), get("orders")),
            moves=get("moves"),
            fields=get("fields"),
            place=info["place"],
            distances=get("distances") if arguments else np.empty(0),
            coordinates=get("coordinates")
            if has("coordinates")
            else np.empty((0, 2), np.intp),
        )
    finally:
        env.close()


@dataclass(frozen=True)
class Walk:
    """A walk, and the world it went through.

    Args:
        fields: ``(N, places)`` bool; where each sensor is on.
        moves: ``(actions, places)``; where an action leads from a place.
        places: ``(steps,)``; where the walk is at each observation.
    """

    fields: NDArray[np.bool_]
    moves: NDArray[np.intp]
    places: NDArray[np.intp]

    @cached_property
    def law(self) -> NDArray[np.float64]:
        """``(places,)``: the walk's stationary law."""
        return stationary(self.moves, int(self.places[0]))

    @cached_property
    def contained(self) -> NDArray[np.uint8]:
        """The codes of the true containments ([GK] eqn:true dir matrix).

        ``a -> b`` iff the field of `a` lies within the field of `b`.
        """
        return codes_of(inclusions(self.fields))


@lru_cache(maxsize=256)
def walk(name: str, seed: int, run: int, steps: int) -> Walk:
    """Return a walk: world and moves have a stream of random numbers each.

    Args:
        name: The setting's.
        seed: From 0 up; with the setting and the run it says all.
        run: From 0 up.
        steps: Observations, at least 1: the first at a place drawn uniformly, the one
            at ``t`` after ``t - 1`` moves drawn uniformly.
    """
    key = (list(SETTINGS).index(name), run)
    of_world, of_moves = np.random.SeedSequence(seed, spawn_key=key).spawn(2)
    world = world_of(SETTINGS[name].world, int(of_world.generate_state(1)[0]))
    draws = np.random.default_rng(of_moves).integers(len(world.moves), size=steps - 1)
    places = follow(world.moves, world.place, draws)
    return Walk(world.fields, world.moves, places)


def follow(
    moves: NDArray[np.intp], start: int, actions: NDArray[np.int64]
) -> NDArray[np.intp]:
    """Return the places of a walk: ``(1 + len(actions),)``, `start` first.

    Args:
        moves: ``(actions, places)``; where an action leads from a place.
        start: A place.
        actions: Which move is made, one after the other.
    """
    leads, places = moves.tolist(), [int(start)]
    for action in actions.tolist():
        places.append(leads[action][places[-1]])
    return np.array(places, np.intp)


def stationary(moves: NDArray[np.intp], start: int) -> NDArray[np.float64]:
    """Return the stationary law of the walk that draws its moves uniformly.

    It is where a lazy walk, which stays every other time, is after 65,536 steps: so a
    walk that is periodic has its law, too.

    Args:
        moves: ``(actions, places)``; where an action leads from a place.
        start: Where the walk begins; places it cannot reach have probability 0.

    Returns:
        ``(places,)``, adds up to 1. O(places³) time.
    """
    places = moves.shape[1]
    chances = np.eye(places) / 2
    for leads in moves:
        chances[np.arange(places), leads] += 0.5 / len(moves)
    law = np.linalg.matrix_power(chances, 1 << 16)[start]
    return np.asarray(law / law.sum(), np.float64)


def thresholded(
    fields: NDArray[np.bool_], law: NDArray[np.float64], threshold: float
) -> NDArray[np.uint8]:
    """Return what is derived of the walk's weights ([GK] eqn:thresholded dir matrix).

    ``a -> b`` iff ``pi(ab*) < min(tau, pi(ab), pi(a*b*), pi(a*b))``.

    Args:
        fields: ``(N, places)``; where each sensor is on.
        law: ``(places,)``, as `stationary` gives it.
        threshold: ``tau``, in (0, 1/4].

    Returns:
        ``(N (N - 1) / 2,)``, a code a pair.
    """
    sensors, places = fields.shape
    literals = np.stack([fields, ~fields], axis=1).reshape(2 * sensors, places)
    both = (literals * law) @ literals.T.astype(np.float64)
    star = np.arange(2 * sensors) ^ 1
    against, converse, rest = both[:, star], both[star], both[star][:, star]
    least = np.minimum(np.minimum(both, converse), np.minimum(rest, threshold))
    return codes_of(against < least - _SLACK)


def codes_of(edges: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the codes of edges that are closed under contraposition.

    Args:
        edges: ``(2N, 2N)``; those between literals of one sensor do not count.

    Returns:
        ``(N (N - 1) / 2,)``; any of the four bits may be on.
    """
    i, j = np.tril_indices(len(edges) // 2, -1)
    bits = (
        edges[2 * i, 2 * j],
        edges[2 * j, 2 * i],
        edges[2 * i, 2 * j + 1],
        edges[2 * i + 1, 2 * j],
    )
    codes = sum(on.astype(np.uint8) << bit for bit, on in enumerate(bits))
    return np.asarray(codes, np.uint8)
