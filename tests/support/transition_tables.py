"""Exact ground truth for environments that have a transition table.

The environment goes on from episode to episode (`Continuing`). A *place* is what has to
be known of it to know what may come next: its state, and whether the episode is over
there, so that the next step resets whatever the action. Everything is exact: places are
those that some walk gets to, transitions those that some walk makes.

References:
    [GK] "Observation Model for DBAs": sensors as subsets of states and of transitions.
    [GK] "Performance of Empirical Agents": the random walk.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.binary_sensors import Environment
from neurosnap.agent.body import Body
from neurosnap.agent.sensor import Sensor
from neurosnap.poc.dual.realization import inclusions
from neurosnap.sensorium import complete

Situation: TypeAlias = tuple[int, bool]  # a state, and whether the episode is over
Move: TypeAlias = tuple[Situation, int, Situation]
_Outcomes: TypeAlias = dict[int, dict[int, list[tuple[float, int, float, bool]]]]


@dataclass(frozen=True)
class Table:
    """A continuing environment as places and transitions between them.

    Transitions are sorted by `before`, `action`, `after`, and none is there twice.
    """

    actions: int
    """How many there are."""
    states: NDArray[np.intp]
    """``(places,)``, the environment's state at each place, ascending."""
    over: NDArray[np.bool_]
    """``(places,)``, whether the episode is over there."""
    before: NDArray[np.intp]
    """``(transitions,)``, the place a transition is from."""
    action: NDArray[np.intp]
    """``(transitions,)``, the action taken there, counted from 0."""
    after: NDArray[np.intp]
    """``(transitions,)``, the place it leads to."""

    @classmethod
    def of(cls, env: Environment) -> Self:
        """Return the table of an environment without its limit on time.

        Args:
            env: Its innermost environment has the attributes `P` and
                `initial_state_distrib` of Gymnasium's toy texts.
        """
        inner: Any = env.unwrapped
        begun = np.flatnonzero(inner.initial_state_distrib).tolist()
        starts = {(state, False) for state in begun}
        moves = _moves(inner.P, starts)
        places = sorted(starts | {after for _, _, after in moves})
        number = {place: k for k, place in enumerate(places)}
        rows = sorted((number[b], a, number[c]) for b, a, c in moves)
        return cls(
            actions=len(inner.P[places[0][0]]),
            states=np.array([state for state, _ in places], np.intp),
            over=np.array([over for _, over in places], np.bool_),
            before=np.array([row[0] for row in rows], np.intp),
            action=np.array([row[1] for row in rows], np.intp),
            after=np.array([row[2] for row in rows], np.intp),
        )

    @property
    def situations(self) -> list[Situation]:
        """What is to be known of each place."""
        return list(zip(self.states.tolist(), self.over.tolist(), strict=True))


def state_fields(env: Environment, table: Table) -> NDArray[np.bool_]:
    """Return where each sensor, of order 0, is on: ``(sensors, places)``.

    Args:
        env: A `BinarySensors`, or one with wrappers around it, whose predicates need
            no info.
        table: Of the same environment.
    """
    sensors = env.get_wrapper_attr("definitions")
    return _readings(sensors, [(value,) for value in _values(env, table)])


def transition_fields(
    env: Environment, table: Table, context: Iterable[tuple[int, int]] = ()
) -> NDArray[np.bool_]:
    """Return where each sensor of an agent is on, over the transitions.

    What is sensed after a transition: state sensors read the place it leads to,
    transition sensors both places, an action is on iff it was taken, and ``α∧a`` iff
    ``α`` was taken and ``a`` held at the place before ([GK] eqn:context; there the
    literal is one of the recorded state, which is the observation once nothing false is
    on record). A reset begins a trajectory: no action is on, no contextual sensor, and
    transition sensors read as if the place had always been this one. So it reads the
    same as the very first observation, which is after no transition and not counted.

    Args:
        env: As for `state_fields`; its sensors may be of order 1, too.
        table: The environment's.
        context: Pairs of an action and a literal of a state sensor, as in `Body`.

    Returns:
        ``(N, transitions)``: `env`'s own sensors, the actions, the contextual sensors.
    """
    sensors: tuple[Sensor, ...] = env.get_wrapper_attr("definitions")
    body = Body(
        own=tuple(sensor.name for sensor in sensors),
        orders=tuple(sensor.order for sensor in sensors),
        actions=tuple(f"action_{k}" for k in range(table.actions)),
        context=tuple(context),
    )
    values = _values(env, table)
    resets = table.over[table.before]
    since = np.where(resets, table.after, table.before)
    pairs = zip(since.tolist(), table.after.tolist(), strict=True)
    own = _readings(sensors, [(values[b], values[a]) for b, a in pairs])
    taken = (table.action == np.arange(table.actions)[:, np.newaxis]) & ~resets
    # Of a transition sensor it is not known before; the context asks for none.
    resting = _readings(sensors, [(value, value) for value in values])
    held = np.stack([complete(column) for column in resting.T], axis=1)
    which, literals = np.array(body.context, np.intp).reshape(-1, 2).T
    contextual = taken[which] & held[literals][:, table.before]
    return np.concatenate([own, taken, contextual])


def recordable(fields: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the true containments that a derived graph with equivalences can have.

    Once every place was seen and the threshold is below every share, ``a → b`` is an
    edge iff ``w_ab* = 0`` and either the square's other three weights are positive or
    ``w_a*b = 0`` as well ([GK] defn:poc graph with equivalences). So of the pairs with
    ``ρ(a) ⊆ ρ(b)`` it lacks those with ``ρ(a)`` empty or ``ρ(b)`` everything, unless
    ``ρ(a) = ρ(b)``. Where no field is empty or full, it lacks nothing, and no closure
    has to be taken.

    Args:
        fields: ``(sensors, places)``, or over transitions.

    Returns:
        ``(2 sensors, 2 sensors)``, for literals of different sensors.
    """
    sensor = np.arange(2 * len(fields)) >> 1
    included = inclusions(fields) & (sensor[:, np.newaxis] != sensor)
    literals = np.stack([fields, ~fields], axis=1).reshape(-1, fields.shape[1])
    somewhere, everywhere = literals.any(axis=1), literals.all(axis=1)
    proper = np.logical_and.outer(somewhere, ~everywhere)
    kept: NDArray[np.bool_] = included & (proper | included.T)
    return kept


def _moves(P: _Outcomes, starts: set[Situation]) -> set[Move]:
    """Return every transition that some walk makes."""
    moves: set[Move] = set()
    found, frontier = set(starts), list(starts)
    while frontier:
        place = frontier.pop()
        state, over = place
        for action, outcomes in P[state].items():
            ways = (
                starts if over else {(int(s), bool(e)) for p, s, _, e in outcomes if p}
            )
            moves |= {(place, action, after) for after in ways}
            frontier += ways - found
            found |= ways
    return moves


def _values(env: Environment, table: Table) -> list[Any]:
    """Return what predicates see at each place."""
    state_of = env.get_wrapper_attr("state_of")
    return [state_of(state, {}) for state in table.states.tolist()]


def _readings(
    sensors: tuple[Sensor, ...], states: list[tuple[Any, ...]]
) -> NDArray[np.bool_]:
    """Return what sensors read of states, the last as many as each looks back."""
    return np.array(
        [[sensor(*row[-sensor.order - 1 :]) for row in states] for sensor in sensors],
        np.bool_,
    )
