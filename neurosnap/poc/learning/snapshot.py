"""The base of all snapshots: weights, poc graph and state.

The derived graph always is the one of the current weights; the state is whatever was
last adopted. How observations are weighed is up to each kind.
"""

import abc
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning import graph_kernels as kernels
from neurosnap.poc.learning.archive import Arrays, entry, pack_arrays, unpack_arrays
from neurosnap.poc.learning.graph_kernels import Pairs
from neurosnap.poc.learning.history_questions import Count, Question, Search
from neurosnap.poc.learning.pairs import Evidence, Weights, leads, pair_of, pairs_of
from neurosnap.poc.learning.reading_history import Newborn
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import Words, as_literal
from neurosnap.sensorium import Sensorium, as_known, complete, pack, unpack

OF_PAIRS = ("joints", "squares", "codes", "since")
"""The arrays of a snapshot whose last axis is the pairs."""
_BITS = 32
_KINDS = {
    "EmpiricalSnapshot": "neurosnap.poc.learning.empirical",
    "DiscountedSnapshot": "neurosnap.poc.learning.discounted",
}  # the modules of the kinds, which import this one
_SCHEMA = 1
_WHOLE = 16  # a row has changed much if more than one in so many of its pairs have


class Changes(NamedTuple):
    """The pairs of sensors whose implications changed, and what they imply now.

    Of a row, the pairs of one sensor with those before it, in which much changed, there
    are all codes; of others the pairs that did.
    """

    rows: NDArray[np.intp]
    """``(R,)``: the sensors of whole rows, ascending."""
    packed: NDArray[np.uint8]
    """Their codes, two a byte, the first in the lower half; each row begins a byte."""
    latter: NDArray[np.int32]
    """``(C,)``: the latter sensors of single pairs, ascending."""
    former: NDArray[np.int32]
    """``(C,)``: their former ones."""
    codes: NDArray[np.uint8]
    """``(C,)``: what relates them."""


class Snapshot(abc.ABC):
    """Weights on pairs of literals, thresholds, and a state ([GK] defn:snapshot).

    Use `EmpiricalSnapshot` or `DiscountedSnapshot`.

    Readings may be unknown. Then the weights of the pairs they are in are not touched,
    and each square is what those observations make of it in which both its sensors
    were known. What is said of one square holds all the same: there is at most one
    implication or equivalence in it, with its contrapositive, and truncation leaves it
    as it is; so coherent projections are coherent and idempotent. And the edges among
    sensors that were always known together are those of a snapshot of them alone. What
    compares squares does not hold beyond that, for how often a sensor was on depends
    on with which other it was known ([GK] defn:probabilistic snapshot, its consistency
    and orientation constraints):

    - the derived graph may have cycles: ``a -> b``, ``b -> c`` and ``c -> a``, each
      from observations of its own, none of which says that two are equivalent;
    - equivalence need not be transitive: ``a <-> b`` and ``b <-> c``, but ``a -> c``;
    - a literal may be equivalent to its own complement: ``a <-> b``, ``b <-> c`` and
      ``a <-> c*``. `PocGraph` says what becomes of it.

    Args:
        sensors: A sensorium, or how many sensors there are.
        threshold: How small, as a share of the clock, the weight against an
            implication must be; in (0, 1/4]. With unknown readings it is a share of
            the observations in which both sensors were known.
        share: The sensors whose pairs with those before them are learned here, where
            several share the pairs; if None, all. `learn`, `evidence` of these
            pairs and `arrays` are then as ever, and there is no graph; of no sensor
            there is one, which `relate` makes.

    Raises:
        InvalidValueError: The threshold is out of range.
    """

    _weights: Weights

    def __init__(
        self,
        sensors: int | Sensorium,
        threshold: float | str,
        share: range | None = None,
    ) -> None:
        if not isinstance(sensors, Sensorium):
            sensors = Sensorium.of(sensors)
        count = len(sensors)
        self._sensorium = sensors
        self._threshold = _checked_threshold(threshold)
        self._share = range(count) if share is None else share
        pairs = pairs_of(self._share)
        self._clock = 0
        self._bits = np.zeros(count, np.uint8)
        self._known = np.zeros(count, np.uint8)
        whole = len(self._share) in (0, count)
        shape = (2 * count, (2 * count + 63) // 64) if whole else (0, 0)
        self._pairs = Pairs(
            threshold=self._threshold,
            codes=np.zeros(len(pairs), np.uint8),
            since=np.zeros(len(pairs), np.uint32),
            latest=np.zeros(count, np.uint32),
            rows=np.zeros(shape, np.uint64),
            first=self._share.start,
        )
        self._born = np.zeros(count, np.uint32)
        self._state = np.zeros(2 * count, np.bool_)
        self._graph: PocGraph | None = None
        self._assumed: Words | None = None

    @property
    def sensorium(self) -> Sensorium:
        """The names of the sensors."""
        return self._sensorium

    @property
    def share(self) -> range:
        """The sensors whose pairs with those before them are learned here."""
        return self._share

    @property
    def clock(self) -> int:
        """The number of observations so far."""
        return self._clock

    @property
    def threshold(self) -> float | str:
        """The threshold as it was given."""
        return self._threshold

    @property
    def codes(self) -> NDArray[np.uint8]:
        """``(P,)``: what relates each pair, as in `poc.learning.pairs`; a copy."""
        return self._pairs.codes.copy()

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
        return self._square(*self._proper(a, b))[0]

    def evidence(self, a: int, b: int) -> Evidence:
        """Return the evidence for and against ``a -> b``, and since when it holds.

        Its contrapositive ``b* -> a*`` has the same, with ``w_ab`` and ``w_a*b*``
        having changed places.

        Raises:
            InvalidValueError: `a` or `b` is no literal, or they have the same sensor.

        Examples:
            >>> from neurosnap import EmpiricalSnapshot
            >>> e = EmpiricalSnapshot(Sensorium(["door", "motion"]), threshold=0.25)
            >>> for bits in [(0, 0), (0, 1), (1, 1), (0, 1)]:
            ...     state = e.observe(bits)
            >>> found = e.evidence(0, 2)
            >>> found.holds, found.since, found.both, found.against, found.total
            (True, 3, 1, 0, 4)
        """
        a, b = self._proper(a, b)
        pair = pair_of(a, b) - pairs_of(self._share).start
        both, against, other, neither = square = self._square(a, b)
        return Evidence(
            total=self._whole(*square),
            both=both,
            neither=neither,
            other=other,
            against=against,
            limit=self._limit(a, b, square),
            holds=leads(self._pairs.codes[pair].item(), a, b),
            since=self._pairs.since[pair].item(),
        )

    def _square(self, a: int, b: int) -> list[float]:
        """Return the weights ``w_ab, w_ab*, w_a*b, w_a*b*`` of a proper pair."""
        self._settle()
        return self._weights.square(a, b, self._total())

    def learn(self, bits: ArrayLike, known: ArrayLike | None = None) -> bool:
        """Learn an observation: weights and graph change, the state stays.

        From the first observation with an unknown reading on, a snapshot takes four
        times the room, and longer to learn.

        Args:
            bits: ``(N,)``, one bit a sensor.
            known: ``(N,)`` bool, which of them are known; if None, all. Of the others
                the bits mean nothing. The clock counts an observation with none, too.

        Returns:
            Whether the derived graph changed. O(N²/2) time.

        Raises:
            ShapeError: Another number of bits.
            InvalidValueError: An entry is not 0 or 1, `known` is not bool, or the
                clock is at its end.
        """
        observation = self._sensorium.observation(bits)
        mask = None if known is None else as_known(known, len(self._sensorium))
        self._check_room()
        self._bits[:] = observation
        if mask is None:
            self._known.fill(1)
        else:
            self._known[:] = mask
            if self._weights.squares is None and not mask.all():
                self._widen()
        changed = self._update()
        self._clock += 1
        if changed:
            self._graph = None
        return changed

    def changes(self) -> Changes:
        """Return the pairs whose implications the last observation changed.

        Only of the latest changes of a row it is known when they were, so this is of no
        use after a `grow`.

        O(N) time, and O(i) for each row `i` in which something changed.
        """
        tick = self._clock
        counts = kernels.count_changes(self._pairs, tick)
        if not tick:
            counts[:] = 0
        whole = _WHOLE * counts > np.arange(counts.size)
        rows, some = np.flatnonzero(whole), np.flatnonzero(~whole & (counts > 0))
        size = int(counts[some].sum())
        latter, former = np.empty(size, np.int32), np.empty(size, np.int32)
        codes = np.empty(size, np.uint8)
        found = latter, former, codes
        kernels.pick_changes(some, self._pairs, tick, *found)
        return Changes(rows, kernels.pack_rows(rows, self._pairs), *found)

    def relate(
        self,
        latter: NDArray[np.intp],
        former: NDArray[np.intp],
        codes: NDArray[np.uint8],
    ) -> bool:
        """Update the graph by pairs whose implications others have learned.

        ``(C,)`` each: their latter sensors, their former ones, and what relates them.

        Returns:
            Whether there is anything. O(C) time.
        """
        kernels.relate(latter, former, codes, self._pairs.rows)
        if codes.size:
            self._graph = None
        return codes.size > 0

    def draw_share(self, share: "Snapshot") -> None:
        """Add the edges of a share's pairs to the graph, which has none of them yet.

        O(N²) time.
        """
        theirs = share._pairs  # noqa: SLF001 - its own class
        kernels.draw(theirs.codes, self._pairs.rows, theirs.first)
        self._graph = None

    def without_pairs(self) -> Self:
        """Return a copy without the pairs, which others have, but with the graph."""
        rest = self.from_arrays(self.head(), range(0))
        rest._pairs.rows[:] = self._pairs.rows  # noqa: SLF001 - its own class
        return rest

    def newborn(
        self,
        sensor: int,
        ticks: int,
        on: Words,
        off: Words,
        unread: Sequence[int] = (),
    ) -> Search[Newborn]:
        """Compute the weights of a newly grown sensor from a history.

        Its weights come from how often it would have read what together with each
        other sensor, as long as the history goes back: the counts of an empirical
        snapshot, the shares of a discounted one, which has forgotten nothing of these.

        Args:
            sensor: Its number; of those behind it none may have been read either.
            ticks: How many the history holds.
            on: ``(W,)``, at which of them it would have read on, as bits of the ring.
            off: ``(W,)``, at which it would have read off.
            unread: Sensors that are not read any more: of pairs with them nothing is
                known, whatever they read once.

        Raises:
            InvalidValueError: There is no such sensor.
        """
        as_literal("literal", 2 * sensor, len(self._state))
        literals = np.arange(2 * sensor)
        question = Question(counts=(Count(on, literals), Count(off, literals)))
        counts = np.array((yield question).counts, np.uint32)
        each = counts.reshape(2, sensor, 2).swapaxes(1, 2).reshape(4, sensor)
        squares, codes = self._judge_newborn(np.ascontiguousarray(each), ticks)
        squares[:, list(unread)], codes[list(unread)] = self._weights.start, 0
        return Newborn(ticks, squares, codes)

    def code_of(self, square: NDArray[np.uint32], sensor: int) -> int:
        """Return what would follow from a newborn's joint readings with a sensor.

        Args:
            square: ``(4,)``: at how many ticks each was, as in `Newborn`.
            sensor: One that is there.
        """
        counts = np.zeros((4, sensor + 1), np.uint32)
        counts[:, sensor] = square
        return int(self._judge_newborn(counts, int(square.sum()))[1][sensor])

    def grow(
        self, sensor: int, name: str, newborn: Newborn, reads: bool | None
    ) -> None:
        """Add a grown sensor, which was never read before, with its weights.

        Nothing else changes.

        Args:
            sensor: As in `newborn`.
            name: What it is called from now on.
            newborn: What is known of it.
            reads: What it reads in the present state; if None, that is unknown.

        Raises:
            InvalidValueError: There is another sensor of that name.
            ShapeError: What is known is not of all sensors before it.
        """
        names = list(self._sensorium)
        as_literal("literal", 2 * sensor, len(self._state))
        names[sensor] = name
        sensorium = Sensorium(names)
        shapes = newborn.squares.shape, newborn.codes.shape
        if shapes != ((4, sensor), (sensor,)):
            raise ShapeError("newborn", f"must be of {sensor} pairs", shapes)
        if self._weights.squares is None:
            self._widen()
        first = sensor * (sensor - 1) // 2
        pairs = slice(first, first + sensor)
        self._weights.set(pairs, newborn.squares)
        self._sensorium = sensorium
        self._born[sensor] = self._clock - newborn.ticks
        kernels.rewire(sensor, newborn.codes, self._pairs, self._clock)
        self._state[2 * sensor] = reads is True
        self._state[2 * sensor + 1] = reads is False
        self._graph = None

    def silence(self, sensor: int) -> None:
        """Forget all that was learned of a sensor: it implies nothing, nor is implied.

        For one that is not read any more; the others keep what they have.

        Raises:
            InvalidValueError: There is no such sensor.
        """
        literal = as_literal("literal", 2 * sensor, len(self._state))
        if self._weights.squares is None:
            self._widen()
        others = [2 * k for k in range(len(self._sensorium)) if k != sensor]
        pairs = [pair_of(literal, other) for other in others]
        self._weights.set(pairs, self._weights.start)
        codes = self._pairs.codes
        self._pairs.since[np.array(pairs)[codes[pairs] > 0]] = self._clock
        codes[pairs] = 0
        self._redraw()
        self._state[[literal, literal ^ 1]] = False
        self._graph = None

    def assume(self, edges: Iterable[tuple[int, int]]) -> None:
        """Add edges ``a -> b`` of literals that hold whatever is read, to the graph.

        Each comes with its contrapositive. They take the place of those before, and are
        no part of what is learned: of its codes, evidence and saved arrays. A share of
        the pairs has no graph, and leaves them out.
        """
        rows = np.zeros_like(self._pairs.rows)
        for a, b in edges if rows.size else ():
            rows[a, b >> 6] |= np.uint64(1 << (b & 63))
        self._assumed = rows if rows.any() else None
        self._graph = None

    def adopt(self, state: NDArray[np.bool_]) -> None:
        """Set the state, ``(2N,)`` bool.

        It should be coherent with respect to the current graph; what is checked is that
        it is a *-selection, which takes no walk over the graph.

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

    def observe(
        self, bits: ArrayLike, known: ArrayLike | None = None
    ) -> NDArray[np.bool_]:
        """Learn an observation and adopt its coherent projection as the state.

        Only what is known is projected: an unknown sensor is in the state as what the
        known ones imply of it, or not at all.

        Arguments and errors are those of `learn`.

        Returns:
            The new state: ``(2N,)`` bool, a copy.

        Examples:
            >>> from neurosnap import EmpiricalSnapshot
            >>> e = EmpiricalSnapshot(Sensorium(["door", "motion"]), threshold=0.25)
            >>> for bits in [(0, 0), (0, 1), (1, 1)]:
            ...     state = e.observe(bits)
            >>> e.observe([True, False], known=[True, False])
            array([ True, False,  True, False])
        """
        self.learn(bits, known)
        return self.project(known)

    def project(self, known: ArrayLike | None = None) -> NDArray[np.bool_]:
        """Adopt the coherent projection of the observation learned last as the state.

        Returns:
            The new state: ``(2N,)`` bool, a copy.
        """
        if known is None and self._assumed is None:
            kernels.project(self._bits, self._pairs.rows, self._state)
        else:
            told = (self._known > 0).repeat(2)
            read = complete(self._bits.view(np.bool_)) & told
            self._state[:] = self.poc_graph().coherent_projection(read)
        return self._state.copy()

    def poc_graph(self) -> PocGraph:
        """Return the derived graph ([GK] defn:poc graph with equivalences).

        Returns:
            It, with what is assumed; the same object until it changes.
        """
        if self._graph is None:
            rows = self._pairs.rows.copy()
            if self._assumed is not None:
                rows |= self._assumed
            self._graph = PocGraph.of_rows(rows)
        return self._graph

    @abc.abstractmethod
    def _update(self) -> bool:
        """Weigh in the known bits at hand; whether the graph changed."""

    def _redraw(self) -> None:
        """Let the graph be what the codes say, where all are there."""
        if len(self._share) == len(self._sensorium):
            self._pairs.rows.fill(0)
            kernels.draw(self._pairs.codes, self._pairs.rows, 0)

    def _settle(self) -> None:  # noqa: B027 - not every kind puts off
        """Bring the weights up to date, where a kind puts off what changes no code."""

    def _widen(self) -> None:
        """Store the four weights of each pair from now on."""
        self._settle()
        self._weights.widen(self._total())

    @abc.abstractmethod
    def _judge_newborn(
        self, counts: NDArray[np.uint32], ticks: int
    ) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Return the weights and codes of a sensor's pairs with those before it.

        ``(4, sensor)`` counts say at how many ticks of the history each joint reading
        was.
        """

    @abc.abstractmethod
    def _total(self) -> float:
        """Return what the four weights of a square add up to if all was known."""

    @abc.abstractmethod
    def _whole(self, *square: float) -> float:
        """Return what four weights add up to, without the errors of rounding."""

    def _limit(self, a: int, b: int, square: Sequence[float]) -> float:
        """Return what the weight against ``a -> b`` must be below, by its square."""
        return float(self._threshold * self._whole(*square))

    @classmethod
    @abc.abstractmethod
    def _blank(cls, sensorium: Sensorium, arrays: Arrays, share: range | None) -> Self:
        """Return a new snapshot with the parameters of a saved one."""

    @abc.abstractmethod
    def _derive(self, arrays: Arrays) -> None:
        """Set codes and rows to what goes with the weights just restored."""

    def to_bytes(self) -> bytes:
        """Return its whole state as the bytes of an ``.npz`` file.

        Equal contents give equal bytes. `from_bytes` of its class, or of `Snapshot` for
        either kind, makes it again.
        """
        return self.packed(self.arrays())

    @classmethod
    def packed(cls, arrays: Arrays) -> bytes:
        """Return arrays of this kind as the bytes of an ``.npz`` file."""
        head = {
            "schema": np.array(_SCHEMA, np.int64),
            "kind": np.array(cls.__name__),
        }
        return pack_arrays(head | arrays)

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Return the snapshot that `to_bytes` packed into `data`, bit for bit.

        Raises:
            InvalidValueError: `data` is damaged, foreign, or of another kind.
        """
        with cls.reading("data"):
            arrays = unpack_arrays(data)
            return cls.kind_of(arrays).from_arrays(arrays)

    @classmethod
    @contextmanager
    def reading(cls, name: str) -> Iterator[None]:
        """Turn errors of reading into one: the data are no snapshot of this kind."""
        try:
            yield
        except ValueError as error:
            rule = f"must be a {cls.__name__} written by this package"
            raise InvalidValueError(name, rule, str(error)) from error

    @classmethod
    def kind_of(cls, arrays: Arrays) -> type[Self]:
        """Return the class that wrote the arrays.

        Raises:
            ValueError: It is none of this kind.
        """
        if entry(arrays, "schema", (), np.int64).item() != _SCHEMA:
            raise ValueError(f"schema: must be {_SCHEMA}")
        name = str(entry(arrays, "kind", (), np.str_).item())
        if name in _KINDS:
            kind: type = getattr(import_module(_KINDS[name]), name)
            if issubclass(kind, cls):
                return kind
        raise ValueError(f"kind: must be {cls.__name__}")

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        self._settle()
        return {
            "names": np.array(self._sensorium.names, np.str_),
            "clock": np.array(self._clock, np.int64),
            "threshold": np.array(self._threshold),
            **self._weights.arrays(),
            "state": np.frombuffer(pack(self._state), np.uint8),
            "since": self._pairs.since,
            **({"born": self._born} if self._born.any() else {}),
        }

    def head(self) -> Arrays:
        """Return the arrays, with nothing of the pairs."""
        arrays = self.arrays()
        empty = {name: arrays[name][..., :0] for name in OF_PAIRS if name in arrays}
        return arrays | empty

    @classmethod
    def from_arrays(cls, arrays: Arrays, share: range | None = None) -> Self:
        """Return the snapshot that has these arrays, as `arrays` gave them.

        Raises:
            ValueError: They make no sense.
        """
        count = arrays["names"].size if "names" in arrays else 0
        names = entry(arrays, "names", (count,), np.str_).tolist()
        snapshot = cls._blank(Sensorium(names), arrays, share)
        snapshot._restore(arrays)  # noqa: SLF001 - its own class
        return snapshot

    def _restore(self, arrays: Arrays) -> None:
        """Take over clock, weights, graph and state."""
        self._clock = entry(arrays, "clock", (), np.int64).item()
        if not 0 <= self._clock < 2**_BITS:
            raise ValueError(f"clock: must be in [0, 2**{_BITS})")
        self._weights.restore(arrays)
        if "born" in arrays:  # only where a sensor has grown
            self._born[:] = entry(arrays, "born", self._born.shape, np.uint32)
            if (self._born > self._clock).any():
                raise ValueError("born: must not be after the clock")
        total = len(self._state)
        octets = entry(arrays, "state", ((total + 7) // 8,), np.uint8)
        self.adopt(unpack(octets.tobytes(), total))
        self._derive(arrays)
        self._pairs.since[:] = entry(
            arrays, "since", self._pairs.since.shape, np.uint32
        )
        if (self._pairs.since > self._clock).any():
            raise ValueError("since: must not be after the clock")

    def _check_room(self) -> None:
        """Refuse an observation that no count has room for."""
        if self._clock + 1 >= 2**_BITS:
            rule = f"must stay below 2**{_BITS}, which the counts have room for"
            raise InvalidValueError("clock", rule, self._clock + 1)

    def _proper(self, a: int, b: int) -> tuple[int, int]:
        """Return two literals that are of different sensors."""
        first = as_literal("a", a, len(self._state))
        second = as_literal("b", b, len(self._state))
        if first >> 1 == second >> 1:
            raise InvalidValueError("pair", "must be of two sensors", (a, b))
        return first, second


def _checked_threshold(threshold: float | str) -> float:
    """Return a threshold as a float."""
    if isinstance(threshold, bool) or not isinstance(
        threshold, float | int | np.number
    ):
        raise InvalidValueError("threshold", 'must be a number, or "auto"', threshold)
    # Written so that NaN is out of range.
    if not 0 < threshold <= 0.25:
        raise InvalidValueError("threshold", "must be in (0, 0.25]", threshold)
    return float(threshold)
