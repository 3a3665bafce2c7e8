"""What can be learned of a world's true order, and how far a learner is from it."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from world.implications import inclusions


def recordable(fields: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the true containments that a derived graph with equivalences can have.

    Once every place was seen and the threshold is below every share, ``a → b`` is an
    edge iff ``w_ab* = 0`` and either the square's other three weights are positive or
    ``w_a*b = 0`` as well ([GK] defn:poc graph with equivalences). So of the pairs with
    ``ρ(a) ⊆ ρ(b)`` it lacks those with ``ρ(a)`` empty or ``ρ(b)`` everything, unless
    ``ρ(a) = ρ(b)``. Where no field is empty or full, it lacks nothing, and no closure
    has to be taken.

    Args:
        fields: ``(sensors, places)``.

    Returns:
        ``(2 sensors, 2 sensors)``, for literals of different sensors.
    """
    included = inclusions(fields)
    literals = np.stack([fields, ~fields], axis=1).reshape(-1, fields.shape[1])
    somewhere, everywhere = literals.any(axis=1), literals.all(axis=1)
    proper = np.logical_and.outer(somewhere, ~everywhere)
    kept: NDArray[np.bool_] = included & (proper | included.T)
    return kept


def rarest_pair(fields: NDArray[np.bool_], shares: NDArray[np.float64]) -> float:
    """Return how often the rarest pair of literals that no implication forbids is on.

    A learning threshold above it puts a falsehood on record in the long run, unless
    another pair of its square is as rare; one below it does not.

    Args:
        fields: ``(sensors, places)``.
        shares: ``(places,)``, the share of the time at each place.

    Returns:
        The least weight in all squares without an implication; 1.0 if there are none.
    """
    literals = np.stack([fields, ~fields], axis=1).reshape(-1, fields.shape[1])
    weights = (literals * shares) @ literals.T
    # Of what is met at all, from the places themselves: sums of shares are rounded.
    met = literals.astype(np.float32) @ literals.T.astype(np.float32) > 0
    sensors = len(fields)
    free = met.reshape(sensors, 2, sensors, 2).all(axis=(1, 3))
    least = weights.reshape(sensors, 2, sensors, 2).min(axis=(1, 3))
    return float(least[free].min(initial=1.0))


def learn(
    fields: NDArray[np.bool_], columns: NDArray[np.intp], threshold: float
) -> NDArray[np.int64]:
    """Return Err(t) of an empirical snapshot on a walk ([GK] eqn:true dir matrix).

    Err counts the ordered pairs of literals on which the derived graph, with
    equivalences, and `recordable` differ.

    Args:
        fields: ``(sensors, columns)``: of places, or of transitions.
        columns: ``(steps,)``: which of them is observed at t = 1, 2, ...
        threshold: In (0, 1/4].

    Returns:
        ``(steps,)``. O(sensors²) time a step.

    Raises:
        InvalidValueError: The threshold is out of range.
    """
    truth = recordable(fields)
    snapshot = EmpiricalSnapshot(len(fields), threshold)
    wrong = int(truth.sum())
    errors = np.empty(len(columns), np.int64)
    for t, column in enumerate(columns.tolist()):
        if snapshot.learn(fields[:, column]):
            wrong = int((snapshot.poc_graph().edges != truth).sum())
        errors[t] = wrong
    return errors
