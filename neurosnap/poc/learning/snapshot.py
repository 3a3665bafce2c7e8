"""The base of all snapshots: weights, poc graph and state.

The derived graph always is the one of the current weights; the state is whatever was
last adopted. How observations are weighed is up to each kind.
"""

import abc
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning import graph_kernels as kernels
from neurosnap.poc.learning.archive import Arrays, entry, pack_arrays, unpack_arrays
from neurosnap.poc.learning.graph_kernels import Pairs
from neurosnap.poc.learning.history_questions import Count, Question, Search
from neurosnap.poc.learning.pairs import Evidence, Weights, leads, pair_of, pairs_of
from neurosnap.poc.learning.reading_history import Newborn
from neurosnap.poc.learning.twins import (
    EQUAL,
    TURNED,
    Twins,
    copy_codes,
    copy_edges,
    copy_pairs,
    longer,
    of_sensors,
)
from neurosnap.poc.order.graph import PocGraph, expanded
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

    _MAKES_EQUAL: ClassVar[bool] = False
    """Whether sensors that have always read the same are equivalent."""
    _twins: Twins
    _pairs: Pairs
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
        self._clock = 0
        self._bits = np.zeros(count, np.uint8)
        self._known = np.zeros(count, np.uint8)
        self._born = np.zeros(count, np.uint32)
        self._state = np.zeros(2 * count, np.bool_)
        self._graph: PocGraph | None = None
        self._assumed: NDArray[np.int64] | None = None
        self._has_twins = self._MAKES_EQUAL and not share
        self._begin(np.zeros(count, np.int64) if self._has_twins else np.arange(count))

    @property
    def _is_whole(self) -> bool:
        """Whether it has all pairs, or none, and so a graph."""
        return len(self._share) in (0, len(self._sensorium))

    def _begin(self, of: NDArray[np.int64]) -> None:
        """Have learned nothing, with a row of pairs for each group of twins."""
        self._twins = Twins(of)
        count = len(self._twins)
        share = range(count) if len(self._share) == len(of) else self._share
        pairs = len(pairs_of(share))
        shape = (2 * count, (2 * count + 63) // 64) if self._is_whole else (0, 0)
        self._pairs = Pairs(
            threshold=self._threshold,
            codes=np.zeros(pairs, np.uint8),
            since=np.zeros(pairs, np.uint32),
            latest=np.zeros(count, np.uint32),
            rows=np.zeros(shape, np.uint64),
            first=share.start,
        )
        self._begin_weights(count, share)

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
        own = np.full(len(self._twins), EQUAL if self._clock else 0, np.uint8)
        return self._of_sensors(self._pairs.codes, own, TURNED)

    @property
    def pairs(self) -> int:
        """Of how many pairs there are weights: twins have them in common."""
        return self._pairs.codes.size

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
        both, against, other, neither = square = self._square(a, b)
        x, y = self._twins.literals[[a, b]].tolist()
        if x >> 1 == y >> 1:  # of twins
            holds, since = x == y and self._clock > 0, min(1, self._clock)
        else:
            pair = pair_of(x, y) - pairs_of(self._share).start
            holds = leads(self._pairs.codes[pair].item(), x, y)
            since = self._pairs.since[pair].item()
        return Evidence(
            total=self._whole(*square),
            both=both,
            neither=neither,
            other=other,
            against=against,
            limit=self._limit(x, y, square),
            holds=holds,
            since=since,
        )

    def _square(self, a: int, b: int) -> list[float]:
        """Return the weights ``w_ab, w_ab*, w_a*b, w_a*b*`` of a proper pair."""
        self._settle()
        x, y = self._twins.literals[[a, b]].tolist()
        return self._weights.square(x, y, self._total())

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
        self._part()
        changed = self._update()
        if not self._clock:  # each two twins are equivalent now
            changed |= len(self._twins) < len(observation)
        self._clock += 1
        if changed:
            self._graph = None
        return changed

    def _part(self) -> None:
        """Part the groups of twins that the bits at hand tell apart."""
        before = len(self._twins)
        parents = self._twins.part(self._bits)
        if not parents.size:
            return
        count, kept = before + parents.size, self._pairs
        rows = np.zeros((2 * count, (2 * count + 63) // 64), np.uint64)
        rows[: 2 * before, : kept.rows.shape[1]] = kept.rows
        pairs = len(pairs_of(range(count))) if len(self._share) else 0
        codes, since = longer(kept.codes, pairs), longer(kept.since, pairs)
        for group, like in enumerate(parents.tolist(), before):
            copy_edges(group, like, rows)
            if pairs:
                copy_codes(group, like, codes)
                copy_pairs(group, like, since, np.uint32(1))
        latest = np.append(kept.latest, kept.latest[parents])
        self._pairs = kept._replace(codes=codes, since=since, latest=latest, rows=rows)
        self._copy_weights(parents)
        self._graph = None

    def _stand_apart(self) -> None:
        """Store the weights of each pair of sensors, be they twins or not."""
        twins, kept = self._twins, self._pairs
        if twins.are_apart:
            return
        self._settle()
        first = np.full(len(twins), min(1, self._clock), np.uint32)
        codes, since = self.codes, self._of_sensors(kept.since, first)
        rows = expanded(kept.rows, twins.literals, equal=self._clock > 0)
        joints = self._of_sensors(self._weights.joints, self._weights.marginals)
        weights = self.arrays() | {"joints": joints}
        self._begin(np.arange(len(self._sensorium)))
        self._restore_weights(weights)
        self._pairs = self._pairs._replace(codes=codes, since=since, rows=rows)
        self._graph = None

    def _of_sensors(
        self,
        values: NDArray[Any],
        own: NDArray[Any],
        turned: NDArray[Any] | None = None,
    ) -> NDArray[Any]:
        """Return a copy of an array of pairs, of those of sensors; see `of_sensors`."""
        if self._twins.are_apart or not len(self._share):
            return values.copy()
        turned = own[:0] if turned is None else turned
        return of_sensors(self._twins.of, values, own, turned)

    def changes(self) -> Changes:
        """Return the pairs whose implications the last observation changed.

        Of a share of the pairs. Only of the latest changes of a row it is known when
        they were, so this is of no use after a `grow`.

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
        told, twins = codes.size > 0, self._twins
        if not twins.are_apart:  # one pair of sensors speaks for those of two groups
            pair = np.stack((latter, former))
            heads = (twins.heads[twins.of[pair]] == pair).all(axis=0)
            (latter, former), codes = twins.of[pair[:, heads]], codes[heads]
            codes = np.where(latter < former, TURNED[codes], codes)
            latter, former = np.maximum(latter, former), np.minimum(latter, former)
        kernels.relate(latter, former, codes, self._pairs.rows)
        if told:
            self._graph = None
        return told

    def draw_share(self, share: "Snapshot") -> None:
        """Add the edges of a share's pairs to the graph, which has none of them yet.

        O(N²) time.
        """
        theirs = share._pairs  # noqa: SLF001 - its own class
        if self._twins.are_apart:
            kernels.draw(theirs.codes, self._pairs.rows, theirs.first)
            self._graph = None
            return
        heads = np.sort(self._twins.heads)
        for head in heads[(heads >= share.share.start) & (heads < share.share.stop)]:
            former = heads[heads < head]
            start = kernels.place_of(head, theirs.first)
            codes = theirs.codes[start + former]
            self.relate(np.full_like(former, head), former, codes)

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
        given = np.array([*edges], np.int64).reshape(-1, 2)
        self._assumed = given if self._is_whole and len(given) else None
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
            twins = self._twins
            found = np.empty(2 * len(twins), np.bool_)
            kernels.project(self._bits[twins.heads], self._pairs.rows, found)
            self._state[:] = found[twins.literals]
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
            rows, literals = self._pairs.rows.copy(), self._twins.literals
            if not self._clock:  # and twins are not equivalent yet
                literals = np.arange(len(self._state))
                rows = np.zeros((len(literals), (len(literals) + 63) // 64), rows.dtype)
            if self._assumed is not None:
                given = literals[self._assumed]
                a, b = given[given[:, 0] != given[:, 1]].T
                bits = np.uint64(1) << (b & 63).astype(np.uint64)
                np.bitwise_or.at(rows, (a, b >> 6), bits)
            self._graph = PocGraph.of_rows(rows, literals)
        return self._graph

    @abc.abstractmethod
    def _begin_weights(self, count: int, share: range) -> None:
        """Set the weights of so many groups of twins, of which none was observed."""

    def _copy_weights(self, parents: NDArray[np.int64]) -> None:
        """Let new groups of twins have the weights of those they were part of."""
        raise NotImplementedError(parents)

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
        self._stand_apart()
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
        twins, weights = self._twins, self._weights.arrays()
        if "marginals" in weights:
            weights["marginals"] = weights["marginals"][twins.of]
        # Of a share that has no pairs: others have those of all sensors.
        name = "twins" if len(self._share) else "groups"
        of = {} if twins.are_apart else {name: twins.of.astype(np.int32)}
        return {
            "names": np.array(self._sensorium.names, np.str_),
            **of,
            "clock": np.array(self._clock, np.int64),
            "threshold": np.array(self._threshold),
            **weights,
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
        self._begin(self._groups_in(arrays))
        self._restore_weights(arrays)
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

    def _groups_in(self, arrays: Arrays) -> NDArray[np.int64]:
        """Return the group of each sensor."""
        count = len(self._sensorium)
        names = ("twins",) if len(self._share) else ("groups", "twins")
        name = next((name for name in names if name in arrays), "")
        if not (self._has_twins and name):
            return np.arange(count)
        of = entry(arrays, name, (count,), np.int32).astype(np.int64)
        if not np.array_equal(np.unique(of), np.arange(of.max(initial=-1) + 1)):
            raise ValueError(f"{name}: must be numbered without a gap")
        return of

    def _restore_weights(self, arrays: Arrays) -> None:
        """Take over the weights, of groups of twins."""
        if "marginals" in arrays and "squares" not in arrays:
            kind, twins = self._weights.marginals.dtype, self._twins
            every = entry(arrays, "marginals", (len(twins.of),), kind)
            if (every[twins.heads][twins.of] != every).any():
                raise ValueError("marginals: must be the same of twins")
            arrays = arrays | {"marginals": every[twins.heads]}
        self._weights.restore(arrays)

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
