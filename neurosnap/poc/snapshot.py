"""Snapshots: what a machine remembers of its observations, and the graph that follows.

The derived graph always is the one of the current weights; the state is whatever was
last adopted. A square of four weights has one free number besides the marginals and
the clock, so one joint weight a pair of sensors is all that is stored.
"""

import abc
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc import kernels
from neurosnap.poc.archive import Archived, Arrays, entry
from neurosnap.poc.codes import excluded, rows_of, strict
from neurosnap.poc.graph import PocGraph
from neurosnap.poc.literals import Words, as_literal
from neurosnap.sensorium import Sensorium, pack, unpack

_BITS = 32
_ROUNDING = 1e-9


class Snapshot(Archived):
    """Weights on pairs of literals, thresholds, and a state ([GK] defn:snapshot).

    Use `EmpiricalSnapshot` or `DiscountedSnapshot`.

    Args:
        sensors: A sensorium, or how many sensors there are.
        threshold: How small, as a share of the clock, the weight against an
            implication must be; one number or a symmetric ``(N, N)`` array with one a
            pair of sensors; each in (0, 1/4].

    Raises:
        ShapeError: `threshold` has another shape.
        InvalidValueError: A threshold is out of range or not symmetric.
    """

    _joints: NDArray[Any]
    _marginals: NDArray[Any]

    def __init__(self, sensors: int | Sensorium, threshold: ArrayLike) -> None:
        if not isinstance(sensors, Sensorium):
            sensors = Sensorium.of(sensors)
        count = len(sensors)
        self._sensorium = sensors
        self._threshold = _checked_threshold(threshold, count)
        self._by_pair = (
            self._threshold.reshape(1)
            if self._threshold.ndim == 0
            else np.append(self._threshold[np.tril_indices(count, -1)], 0.25)
        )
        self._clock = 0
        self._bits = np.zeros(count, np.uint8)
        self._codes = np.zeros(count * (count - 1) // 2, np.uint8)
        self._rows: Words = np.zeros((2 * count, (2 * count + 63) // 64), np.uint64)
        self._state = np.zeros(2 * count, np.bool_)
        self._graphs: dict[bool, PocGraph] = {}

    @property
    def sensorium(self) -> Sensorium:
        """The names of the sensors."""
        return self._sensorium

    @property
    def clock(self) -> int:
        """The number of observations so far."""
        return self._clock

    @property
    def threshold(self) -> float | NDArray[np.float64]:
        """The threshold as it was given: a number, or a new ``(N, N)`` array."""
        if self._threshold.ndim == 0:
            return self._threshold.item()
        return self._threshold.copy()

    @property
    def state(self) -> NDArray[np.bool_]:
        """``(2N,)`` bool, a copy; a *-selection, coherent when it was adopted."""
        return self._state.copy()

    def weight(self, a: int, b: int) -> float:
        """Return the weight of a proper pair of literals.

        Returns:
            An int for an empirical snapshot, a float for a discounted one.

        Raises:
            InvalidValueError: `a` or `b` is no literal, or they have the same sensor.
        """
        first = as_literal("a", a, len(self._state))
        second = as_literal("b", b, len(self._state))
        i, j = max(first, second) >> 1, min(first, second) >> 1
        if i == j:
            raise InvalidValueError("pair", "must be of two sensors", (a, b))
        joint = self._joints[i * (i - 1) // 2 + j].item()
        mine = self._marginals[first >> 1].item()
        yours = self._marginals[second >> 1].item()
        match first & 1, second & 1:
            case 0, 0:
                return joint  # type: ignore[no-any-return]
            case 0, 1:
                return mine - joint  # type: ignore[no-any-return]
            case 1, 0:
                return yours - joint  # type: ignore[no-any-return]
            case _:
                return self._total() - mine - yours + joint  # type: ignore[no-any-return]

    def learn(self, bits: ArrayLike) -> bool:
        """Take in an observation: weights and graph follow, the state stays.

        Args:
            bits: ``(N,)``, one bit a sensor.

        Returns:
            Whether the derived graph changed. O(N²/2) time.

        Raises:
            ShapeError: Another number of bits.
            InvalidValueError: An entry is not 0 or 1, or the clock is at its end.
        """
        self._bits[:] = self._sensorium.observation(bits)
        changed = bool(self._update())
        self._clock += 1
        if changed:
            self._graphs.clear()
        return changed

    def adopt(self, state: NDArray[np.bool_]) -> None:
        """Set the state.

        It should be coherent with respect to the current graph; what is checked is
        that it is a *-selection, which takes no walk over the graph.

        Args:
            state: ``(2N,)`` bool.

        Raises:
            ShapeError: Another shape.
            InvalidValueError: Not bool, or it holds a literal and its complement.
        """
        state = np.asarray(state)
        if state.shape != self._state.shape:
            raise ShapeError("state", f"must be ({len(self._state)},)", state.shape)
        if state.dtype != np.bool_:
            raise InvalidValueError("state", "must be bool", state.dtype)
        both = state[::2] & state[1::2]
        if both.any():
            rule = "must not hold a literal and its complement"
            name = self._sensorium.names[int(both.argmax())]
            raise InvalidValueError("state", rule, name)
        self._state[:] = state

    def observe(self, bits: ArrayLike) -> NDArray[np.bool_]:
        """Learn an observation and adopt its coherent projection as the state.

        Args:
            bits: ``(N,)``, one bit a sensor.

        Returns:
            The new state: ``(2N,)`` bool, a copy.

        Raises:
            ShapeError: Another number of bits.
            InvalidValueError: An entry is not 0 or 1, or the clock is at its end.

        Example:
            >>> e = EmpiricalSnapshot(Sensorium(["door", "motion"]))
            >>> e.observe([True, False])
            array([ True, False, False,  True])
        """
        self.learn(bits)
        kernels.project(self._bits, self._rows, self._state)
        return self._state.copy()

    def poc_graph(self, equivalences: bool = True) -> PocGraph:
        """Return the derived graph ([GK] defn:poc graph with equivalences).

        Args:
            equivalences: Whether it has the edges of equivalent literals.

        Returns:
            The same object until the graph changes.
        """
        if equivalences not in self._graphs:
            codes = self._codes if equivalences else strict(self._codes)
            rows = (
                self._rows.copy()
                if equivalences
                else rows_of(codes, len(self._sensorium))
            )
            self._graphs[equivalences] = PocGraph._derived(rows)  # noqa: SLF001
        return self._graphs[equivalences]

    @abc.abstractmethod
    def _update(self) -> bool:
        """Weigh in the bits at hand; whether the graph changed."""

    @abc.abstractmethod
    def _total(self) -> float:
        """Return what the four weights of a square add up to."""

    @classmethod
    @abc.abstractmethod
    def _blank(cls, sensorium: Sensorium, arrays: Arrays) -> Self:
        """Return a new snapshot with the parameters of a saved one."""

    @abc.abstractmethod
    def _derive(self, arrays: Arrays) -> None:
        """Set codes and rows to what goes with the weights just restored."""

    def arrays(self) -> Arrays:
        """Return all there is to know, by name."""
        return {
            "names": np.array(self._sensorium.names, np.str_),
            "clock": np.array(self._clock, np.int64),
            "threshold": self._threshold,
            "joints": self._joints,
            "marginals": self._marginals,
            "state": np.frombuffer(pack(self._state), np.uint8),
        }

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> Self:
        """Return the snapshot that has these arrays.

        Raises:
            ValueError: They make no sense.
        """
        count = arrays["names"].size if "names" in arrays else 0
        names = entry(arrays, "names", (count,), np.str_).tolist()
        snapshot = cls._blank(Sensorium(names), arrays)
        snapshot._restore(arrays)  # noqa: SLF001 - its own class
        return snapshot

    def _restore(self, arrays: Arrays) -> None:
        """Take over clock, weights, graph and state."""
        self._clock = entry(arrays, "clock", (), np.int64).item()
        if not 0 <= self._clock < 2**_BITS:
            raise ValueError(f"clock: must be in [0, 2**{_BITS})")
        for key, mine in (("joints", self._joints), ("marginals", self._marginals)):
            mine[:] = entry(arrays, key, mine.shape, mine.dtype)
        total = len(self._state)
        octets = entry(arrays, "state", ((total + 7) // 8,), np.uint8)
        self.adopt(unpack(octets.tobytes(), total))
        self._derive(arrays)

    def _squares(self) -> NDArray[Any]:
        """Return the four weights of each pair: ``w_ij, w_ij*, w_i*j, w_i*j*``."""
        i, j = np.tril_indices(len(self._marginals), -1)
        wide = np.int64 if self._marginals.dtype.kind == "u" else np.float64
        both, mine = self._joints.astype(wide), self._marginals.astype(wide)
        rest = self._total() - mine[i] - mine[j] + both
        return np.stack([both, mine[i] - both, mine[j] - both, rest])


class EmpiricalSnapshot(Snapshot):
    """Counts every pair of sensations, and forgets none ([GK] defn:empirical snapshot).

    Its test is exact: weights are integers, compared with ``threshold * clock`` in
    double precision. Counts are 32 bits wide, which the clock must not outgrow.

    Args:
        sensors: A sensorium, or how many sensors there are.
        threshold: One number, or a symmetric ``(N, N)`` array; in (0, 1/4].

    Raises:
        ShapeError: `threshold` has another shape.
        InvalidValueError: A threshold is out of range or not symmetric.

    Example:
        >>> e = EmpiricalSnapshot(Sensorium(["door", "motion"]), threshold=0.25)
        >>> for bits in [(0, 0), (0, 1), (1, 1)]:
        ...     state = e.observe(bits)
        >>> e.poc_graph().implications(e.sensorium)
        [('door', 'motion')]
        >>> e.weight(0, 2), e.weight(0, 3)
        (1, 0)
    """

    def __init__(self, sensors: int | Sensorium, threshold: ArrayLike = 0.01) -> None:
        super().__init__(sensors, threshold)
        self._joints = np.zeros(self._codes.size, np.uint32)
        self._marginals = np.zeros(len(self._sensorium), np.uint32)

    def _update(self) -> bool:
        if self._clock + 1 >= 2**_BITS:
            rule = f"must stay below 2**{_BITS}, which the counts have room for"
            raise InvalidValueError("clock", rule, self._clock + 1)
        return bool(self._count(self._clock + 1))

    def _count(self, clock: int) -> object:
        """Count the bits at hand and derive the graph for `clock`."""
        return kernels.learn_counts(
            self._bits,
            self._joints,
            self._marginals,
            clock,
            self._by_pair,
            self._codes,
            self._rows,
        )

    def _total(self) -> int:
        return self._clock

    @classmethod
    def _blank(cls, sensorium: Sensorium, arrays: Arrays) -> Self:
        return cls(sensorium, _saved_threshold(arrays, len(sensorium)))

    def _derive(self, arrays: Arrays) -> None:
        if self._squares().min(initial=0) < 0 or (self._marginals > self._clock).any():
            raise ValueError("joints: must be consistent with marginals and clock")
        if self._clock:
            self._count(self._clock)


class DiscountedSnapshot(Snapshot):
    """Weighs the present more than the past ([GK] defn:discounted update).

    Each observation takes a share ``1 - decay`` of the weight; the graph is derived
    from the new weights; then every square with an implication gives up the weight
    against it ([GK] snapshot truncation), which leaves the derived graph as it is.
    Starts with every weight at 1/4. Sensors that are alike tie all the time, so
    smaller means by more than 1e-12, and zero means at most that.

    Args:
        sensors: A sensorium, or how many sensors there are.
        threshold: One number, or a symmetric ``(N, N)`` array; in (0, 1/4].
        decay: What is kept of a weight each time, in [0, 1).

    Raises:
        ShapeError: `threshold` has another shape.
        InvalidValueError: A threshold or the decay is out of range.

    Example:
        >>> d = DiscountedSnapshot(Sensorium(["door", "motion"]), 0.25, decay=0.5)
        >>> for bits in [(0, 0), (0, 1), (1, 1)]:
        ...     state = d.observe(bits)
        >>> d.poc_graph().implications(d.sensorium)
        [('door', 'motion')]
        >>> d.weight(0, 2), d.weight(0, 3)
        (0.5625, 0.0)
    """

    def __init__(
        self,
        sensors: int | Sensorium,
        threshold: ArrayLike = 1 / 8000,
        decay: float = 1 - 2**-6,
    ) -> None:
        super().__init__(sensors, threshold)
        if isinstance(decay, bool) or not isinstance(decay, float | int | np.number):
            raise InvalidValueError("decay", "must be a number", decay)
        if not 0 <= decay < 1:
            raise InvalidValueError("decay", "must be in [0, 1)", decay)
        self._decay = float(decay)
        self._joints = np.full(self._codes.size, 0.25)
        self._marginals = np.full(len(self._sensorium), 0.5)

    @property
    def decay(self) -> float:
        """What is kept of a weight each time."""
        return self._decay

    def _update(self) -> bool:
        return bool(
            kernels.learn_discounted(
                self._bits,
                self._joints,
                self._marginals,
                self._decay,
                self._by_pair,
                self._codes,
                self._rows,
            )
        )

    def _total(self) -> float:
        return 1.0

    def arrays(self) -> Arrays:
        """Return all there is to know, by name."""
        # Truncation rounds, and a difference at the very edge of the tolerance may
        # fall on its other side: so the codes are kept and not derived again.
        decay = np.array(self._decay)
        return super().arrays() | {"decay": decay, "codes": self._codes}

    @classmethod
    def _blank(cls, sensorium: Sensorium, arrays: Arrays) -> Self:
        decay = entry(arrays, "decay", (), np.float64).item()
        return cls(sensorium, _saved_threshold(arrays, len(sensorium)), decay)

    def _derive(self, arrays: Arrays) -> None:
        squares = self._squares()
        inside = (self._marginals >= 0) & (self._marginals <= 1)
        if not (inside.all() and (squares >= -_ROUNDING).all()):
            raise ValueError("joints: must be consistent with marginals")
        codes = entry(arrays, "codes", self._codes.shape, np.uint8)
        zero = excluded(codes, squares)
        if not (zero <= _ROUNDING).all() or (not self._clock and codes.any()):
            raise ValueError("codes: must go with the weights")
        self._codes[:] = codes
        self._rows[:] = rows_of(codes, len(self._sensorium))


def _checked_threshold(threshold: ArrayLike, count: int) -> NDArray[np.float64]:
    """Return a threshold as a 0-d or ``(N, N)`` array of its own."""
    try:
        array = np.array(threshold, np.float64)
    except (TypeError, ValueError) as error:
        rule = "must be a number or an array of numbers"
        raise InvalidValueError("threshold", rule, threshold) from error
    if array.ndim and array.shape != (count, count):
        raise ShapeError("threshold", f"must be ({count}, {count})", array.shape)
    # Written so that NaN is out of range.
    wrong = ~((array > 0) & (array <= 0.25))
    if wrong.any():
        value = array[wrong][0].item()
        raise InvalidValueError("threshold", "must be in (0, 0.25]", value)
    if array.ndim and (array != array.T).any():
        i, j = (int(k) for k in np.argwhere(array != array.T)[0])
        value = (array[i, j].item(), array[j, i].item())
        rule = f"must be symmetric (at {i}, {j})"
        raise InvalidValueError("threshold", rule, value)
    return array


def _saved_threshold(arrays: Arrays, count: int) -> NDArray[np.float64]:
    """Return the threshold of a saved snapshot."""
    scalar = arrays.get("threshold", np.empty(())).ndim == 0
    return entry(arrays, "threshold", () if scalar else (count, count), np.float64)
