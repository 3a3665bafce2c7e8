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
    Parted,
    Twins,
    copy_edges,
    literals_of,
)
from neurosnap.poc.order.graph import PocGraph, expanded
from neurosnap.poc.order.literal_sets import Words, as_literal
from neurosnap.sensorium import Sensorium, as_known, complete, pack, unpack

_OF_SENSORS = {"marginals": 1, "spells": 2, "last": 1}
"""The arrays whose last axis is the sensors, and how many numbers each sensor has."""
OF_PAIRS = ("joints", "squares", "codes", "since")
"""The arrays of a snapshot whose last axis is the pairs."""
_BITS = 32
_KINDS = {
    "EmpiricalSnapshot": "neurosnap.poc.learning.empirical",
    "DiscountedSnapshot": "neurosnap.poc.learning.discounted",
}  # the modules of the kinds, which import this one
_SCHEMA = 1


class Changes(NamedTuple):
    """The pairs of sensors whose implications changed, and what they imply now.

    Of twins the first speaks for all.
    """

    latter: NDArray[np.int32]
    """``(C,)``: their latter sensors."""
    former: NDArray[np.int32]
    """``(C,)``: their former ones."""
    codes: NDArray[np.uint8]
    """``(C,)``: what relates them; pairs are in the order of their sensors."""


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
        self._begin(
            np.zeros(count, np.int64) if self._MAKES_EQUAL else np.arange(count)
        )

    @property
    def _is_whole(self) -> bool:
        """Whether it has all pairs, or none, and so a graph."""
        return len(self._share) in (0, len(self._sensorium))

    def _begin(self, labels: NDArray[np.int64]) -> None:
        """Have learned nothing; sensors with one label are twins, see `Twins`."""
        if len(self._share):  # nothing is learned of sensors behind it
            self._twins = Twins(labels[: self._share.stop], self._share.start)
        else:
            self._twins = Twins(labels)
        count, rows = len(self._twins), self._rows
        pairs = len(pairs_of(rows))
        shape = (2 * count, (2 * count + 63) // 64) if self._is_whole else (0, 0)
        self._pairs = Pairs(
            threshold=self._threshold,
            codes=np.zeros(pairs, np.uint8),
            since=np.zeros(pairs, np.uint32),
            latest=np.zeros(count, np.uint32),
            rows=np.zeros(shape, np.uint64),
            first=rows.start,
        )
        self._begin_weights(count, rows)

    @property
    def _rows(self) -> range:
        """The groups of twins whose pairs with those before them are learned here."""
        return self._twins.rows if len(self._share) else range(0)

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
    def twins(self) -> Twins:
        """The groups of sensors that have weights in common; not to be changed."""
        return self._twins

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
            pair = pair_of(x, y) - pairs_of(self._rows).start
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
        parted, kept = self._twins.part(self._bits), self._pairs
        if parted is None:
            return
        rows = kept.rows
        if self._is_whole:
            count = len(self._twins)
            rows = np.zeros((2 * count, (2 * count + 63) // 64), np.uint64)
            rows[: len(kept.rows), : kept.rows.shape[1]] = kept.rows
            for group in parted.rows:
                copy_edges(group, parted.source[group], rows)
        self._copy_weights(parted)
        size = len(pairs_of(self._rows))
        equal = np.full(parted.before, EQUAL, np.uint8)
        first = np.ones(parted.before, np.uint32)
        self._pairs = kept._replace(
            codes=parted.of_pairs(kept.codes, size, equal, TURNED),
            since=parted.of_pairs(kept.since, size, first),
            latest=parted.of_groups(kept.latest),
            rows=rows,
            first=self._rows.start,
        )
        self._graph = None

    def stand_apart(self) -> None:
        """Store the weights of each pair of sensors, be they twins or not."""
        twins, kept = self._twins, self._pairs
        if twins.are_apart:
            return
        self._settle()
        first = np.full(len(twins), min(1, self._clock), np.uint32)
        codes, since = self.codes, self._of_sensors(kept.since, first)
        rows = kept.rows
        if self._is_whole:
            rows = expanded(rows, twins.literals, equal=self._clock > 0)
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
        """Return a copy of an array of pairs, of those of sensors; see `Twins`."""
        if self._twins.are_apart or not len(self._share):
            return values.copy()
        return self._twins.of_sensors(values, own, turned)

    def changes(self) -> Changes:
        """Return the pairs whose implications the last observation changed.

        Of a share of the pairs. Only of the latest changes of a row it is known when
        they were, so this is of no use after a `grow`.

        O(N) time, and O(i) for each row `i` in which something changed.
        """
        tick, twins = self._clock, self._twins
        room = range(twins.former, twins.first)
        found = kernels.pick_changes(self._pairs, tick, room.start, room.stop)
        (i, j), codes = twins.heads[found[:, :2].T], found[:, 2].astype(np.uint8)
        codes = np.where(i < j, TURNED[codes], codes)
        latter, former = np.maximum(i, j), np.minimum(i, j)
        order = np.lexsort((former, latter))  # not as groups happen to be numbered
        ends = latter[order].astype(np.int32), former[order].astype(np.int32)
        return Changes(*ends, codes[order])

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
        heads = self._twins.heads[self._twins.in_order]
        for latter, former, pairs in share.twins.places_of(heads):
            self.relate(np.full_like(former, latter), former, theirs.codes[pairs])

    def without_pairs(self) -> Self:
        """Return a copy without the pairs, which others have, but with the graph."""
        rest, order = self.from_arrays(self.head(), range(0)), self._twins.in_order
        rest._pairs.rows[:] = expanded(  # noqa: SLF001 - its own class
            self._pairs.rows, literals_of(order), equal=False
        )
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
        former = np.arange(sensor)
        latter = np.full_like(former, sensor)
        self._replace(latter, former, newborn.codes, newborn.squares)
        self._sensorium = sensorium
        self._born[sensor] = self._clock - newborn.ticks
        self._state[2 * sensor] = reads is True
        self._state[2 * sensor + 1] = reads is False

    def silence(self, sensor: int) -> None:
        """Forget all that was learned of a sensor: it implies nothing, nor is implied.

        For one that is not read any more; the others keep what they have.

        Raises:
            InvalidValueError: There is no such sensor.
        """
        literal = as_literal("literal", 2 * sensor, len(self._state))
        others = np.delete(np.arange(len(self._sensorium)), sensor)
        latter, former = np.maximum(others, sensor), np.minimum(others, sensor)
        codes = np.zeros(len(others), np.uint8)
        self._replace(latter, former, codes, self._weights.start)
        self._state[[literal, literal ^ 1]] = False

    def _replace(
        self,
        latter: NDArray[np.intp],
        former: NDArray[np.intp],
        codes: NDArray[np.uint8],
        squares: NDArray[Any] | float,
    ) -> None:
        """Let pairs of sensors have other weights and codes, as far as they are here.

        ``(C,)`` each, and ``(4, C)``; or the same for all of them.
        """
        if self._weights.squares is None:
            self._widen()
        if self._is_whole:
            kernels.relate(latter, former, codes, self._pairs.rows)
        here = (latter >= self._share.start) & (latter < self._share.stop)
        pairs = (latter * (latter - 1) // 2 + former)[here]
        pairs -= pairs_of(self._share).start
        squares = squares[:, here] if isinstance(squares, np.ndarray) else squares
        self._weights.set(pairs, squares)
        changed = pairs[self._pairs.codes[pairs] != codes[here]]
        self._pairs.codes[pairs] = codes[here]
        self._pairs.since[changed] = self._clock
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
                if self._assumed is None:
                    self._graph = PocGraph.without_edges(len(literals))
                    return self._graph
                rows = np.zeros((len(literals), (len(literals) + 63) // 64), rows.dtype)
            if self._assumed is not None:
                given = literals[self._assumed]
                a, b = given[given[:, 0] != given[:, 1]].T
                bits = np.uint64(1) << (b & 63).astype(np.uint64)
                np.bitwise_or.at(rows, (a, b >> 6), bits)
            self._graph = PocGraph.of_rows(rows, literals)
        return self._graph

    @abc.abstractmethod
    def _begin_weights(self, count: int, rows: range) -> None:
        """Set the weights of so many groups of twins, of which none was observed."""

    def _copy_weights(self, parted: Parted) -> None:
        """Let new groups of twins have the weights of those they were part of."""
        raise NotImplementedError(parted)

    def _read(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the bits at hand, and which of them are known, of groups of twins."""
        twins = self._twins
        return twins.of_groups(self._bits), twins.of_groups(self._known)

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
        self.stand_apart()
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
            weights["joints"] = self._ordered(weights["joints"])
        ranks = twins.ranks
        alone = np.array_equal(ranks, np.arange(len(ranks)))
        of = {} if alone else {"twins": ranks.astype(np.int32)}
        return {
            "names": np.array(self._sensorium.names, np.str_),
            **of,
            "clock": np.array(self._clock, np.int64),
            "threshold": np.array(self._threshold),
            **weights,
            "state": np.frombuffer(pack(self._state), np.uint8),
            "since": self._ordered(self._pairs.since),
            **({"born": self._born} if self._born.any() else {}),
        }

    def _ordered(
        self, values: NDArray[Any], turned: NDArray[Any] | None = None
    ) -> NDArray[Any]:
        """Return an array of pairs as it is saved: equal contents are equal there."""
        return self._twins.ordered(values, turned) if len(self._share) else values

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
        if (sensors := len(self._twins.of)) < len(self._sensorium):
            # Of a share: there may be those of all sensors.
            arrays = arrays | {
                name: arrays[name][..., : width * sensors]
                for name, width in _OF_SENSORS.items()
                if name in arrays
            }
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
        if not (self._MAKES_EQUAL and "twins" in arrays):
            return np.arange(count)
        of = entry(arrays, "twins", (count,), np.int32).astype(np.int64)
        if not np.array_equal(Twins(of).of, of):
            raise ValueError("twins: must be numbered by the first of each group")
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
