"""Exact facts and long walks from an environment's transition table.

The environment goes on from episode to episode (`Continuing`). A
*place* is what has to be known of it to know what may come next: its state, and whether
the episode is over there, so that the next step resets whatever the action. A reset is
no action's doing. Everything is exact: places are those that some walk gets to,
transitions those that some walk makes.

References:
    [GK] "Observation Model for DBAs": sensors as subsets of states and of transitions.
    [GK] "Performance of Empirical Agents": the random walk, and its stationary shares.
"""

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.binary_sensors import Environment
from neurosnap.agent.body import Body
from neurosnap.agent.sensor import Sensor
from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import complete

_Place: TypeAlias = tuple[int, bool]
_Move: TypeAlias = tuple[_Place, int, _Place]
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
    start: NDArray[np.float64]
    """``(places,)``, the probability of beginning there."""
    before: NDArray[np.intp]
    """``(transitions,)``, the place a transition is from."""
    action: NDArray[np.intp]
    """``(transitions,)``, the action taken there, counted from 0."""
    after: NDArray[np.intp]
    """``(transitions,)``, the place it leads to."""
    chance: NDArray[np.float64]
    """``(transitions,)``, its probability, in (0, 1], given place and action."""

    @classmethod
    def of(cls, env: Environment) -> Self:
        """Return the table of an environment, as if its episodes went on for ever.

        A limit on their time is not in it.

        Args:
            env: Its innermost environment has the attributes `P` and
                `initial_state_distrib` of Gymnasium's toy texts.

        Raises:
            InvalidValueError: It has none of them, or is said to depart from them
                (a taxi's fickle passenger).
        """
        inner: Any = env.unwrapped
        if not (hasattr(inner, "P") and hasattr(inner, "initial_state_distrib")):
            rule = "must have a transition table and a distribution of starts"
            raise InvalidValueError("environment", rule, inner)
        if getattr(inner, "fickle_passenger", False):
            rule = "must have passengers that keep to its transition table"
            raise InvalidValueError("environment", rule, inner)
        starts = {
            (state, False): float(share)
            for state, share in enumerate(inner.initial_state_distrib)
            if share > 0
        }
        moves = _moves(inner.P, starts)
        places = sorted(starts.keys() | {after for _, _, after in moves})
        number = {place: k for k, place in enumerate(places)}
        rows = sorted((number[b], a, number[c], p) for (b, a, c), p in moves.items())
        return cls(
            actions=len(inner.P[places[0][0]]),
            states=np.array([state for state, _ in places], np.intp),
            over=np.array([over for _, over in places], np.bool_),
            start=np.array([starts.get(place, 0.0) for place in places]),
            before=np.array([row[0] for row in rows], np.intp),
            action=np.array([row[1] for row in rows], np.intp),
            after=np.array([row[2] for row in rows], np.intp),
            chance=np.array([row[3] for row in rows]),
        )

    def walk(
        self, steps: int, generator: np.random.Generator
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return a random walk, every action as likely as any other.

        Args:
            steps: How many.
            generator: Draws start, actions and outcomes.

        Returns:
            The places ``(steps + 1,)``, the start first; the actions ``(steps,)``.
        """
        # Where each place and action may lead, and all but the last of the cumulative
        # probabilities: what is drawn falls between two of them.
        rows = self.before * self.actions + self.action
        cuts = np.flatnonzero(np.diff(rows)) + 1
        ways = [ends.tolist() for ends in np.split(self.after, cuts)]
        shares = [
            list(accumulate(p.tolist()))[:-1] for p in np.split(self.chance, cuts)
        ]
        actions = generator.integers(self.actions, size=steps)
        place = int(generator.choice(len(self.start), p=self.start))
        places = [place]
        draws = generator.random(steps)
        for action, draw in zip(actions.tolist(), draws.tolist(), strict=True):
            row = place * self.actions + action
            place = ways[row][bisect_right(shares[row], draw)]
            places.append(place)
        return np.array(places, np.intp), actions.astype(np.intp)

    def columns(
        self, places: NDArray[np.intp], actions: NDArray[np.intp]
    ) -> NDArray[np.intp]:
        """Return which transition each step of a walk is: ``(steps,)``.

        Args:
            places: ``(steps + 1,)``, as `walk` returns them, and so are the others.
            actions: ``(steps,)``.
        """
        shape = len(self.states), self.actions, len(self.states)
        # Transitions are sorted, and so are their numbers.
        known = np.ravel_multi_index((self.before, self.action, self.after), shape)
        made = np.ravel_multi_index((places[:-1], actions, places[1:]), shape)
        return np.searchsorted(known, made)

    def stationary(self) -> NDArray[np.float64]:
        """Return the share of a random walk's time at each place: ``(places,)``.

        O(places³) time.

        Raises:
            InvalidValueError: It depends on where the walk gets caught.
        """
        count = len(self.states)
        flow = np.zeros((count, count))
        np.add.at(flow, (self.after, self.before), self.chance / self.actions)
        balance = np.concatenate([flow - np.eye(count), np.ones((1, count))])
        right = np.append(np.zeros(count), 1.0)
        shares, _, rank, _ = np.linalg.lstsq(balance, right)
        if rank < count:
            rule = "must not catch the walk in one of several parts"
            raise InvalidValueError("environment", rule, f"{count} places, rank {rank}")
        return np.asarray(shares)


def state_fields(env: Environment, table: Table) -> NDArray[np.bool_]:
    """Return where each sensor is on: ``(sensors, places)``.

    Args:
        env: A `BinarySensors`, or one with wrappers around it, whose predicates need
            no info.
        table: Of the same environment.

    Raises:
        InvalidValueError: A sensor is of an order above 0.
    """
    values = _values(env, table)
    return _readings(_definitions(env, most=0), [(value,) for value in values])


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
        env: As for `state_fields`.
        table: The environment's.
        context: Pairs of an action and a literal of a state sensor, as in `Body`.

    Returns:
        ``(N, transitions)``: `env`'s own sensors, the actions, the contextual sensors.

    Raises:
        InvalidValueError: A sensor is of an order above 1, or a context names an action
            or a literal that there is not, or one of a transition sensor.
    """
    sensors = _definitions(env, most=1)
    body = Body(
        own=tuple(sensor.name for sensor in sensors),
        orders=tuple(sensor.order for sensor in sensors),
        actions=tuple(f"action_{k}" for k in range(table.actions)),
        context=tuple(context),
    )
    for action, literal in body.context:
        if sensors[literal >> 1].order:
            rule = "must be of literals of state sensors"
            raise InvalidValueError("context", rule, (action, literal))
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


def _moves(P: _Outcomes, starts: dict[_Place, float]) -> dict[_Move, float]:
    """Return every transition that some walk makes, with its probability."""
    moves: dict[_Move, float] = {}
    found, frontier = set(starts), list(starts)
    while frontier:
        place = frontier.pop()
        state, over = place
        for action, outcomes in P[state].items():
            ways = (
                starts.items()
                if over
                else [((int(s), bool(end)), float(p)) for p, s, _, end in outcomes]
            )
            for after, chance in ways:
                if chance > 0:
                    move = (place, action, after)
                    moves[move] = moves.get(move, 0.0) + chance
                    if after not in found:
                        found.add(after)
                        frontier.append(after)
    return moves


def _definitions(env: Environment, most: int) -> tuple[Sensor, ...]:
    sensors: tuple[Sensor, ...] = env.get_wrapper_attr("definitions")
    for sensor in sensors:
        if sensor.of_reward:
            rule = "must be of states: the table has no rewards"
            raise InvalidValueError(f"sensor {sensor.name}", rule, "a reward")
        if sensor.order > most:
            rule = f"must be of order {most} at most"
            raise InvalidValueError(f"sensor {sensor.name}", rule, sensor.order)
    return sensors


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
