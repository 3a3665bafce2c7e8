"""The graph of implications between sensors: with a → b it also has b* → a*.

``a <= b`` iff a directed path leads from ``a`` to ``b``; every edge ``a -> b`` comes
with ``b* -> a*``. A graph never changes: costly results are computed on first use and
kept.
"""

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order import literal_set_kernels as kernels
from neurosnap.poc.order.closure_and_reduction import Order, order_of, wired
from neurosnap.poc.order.literal_sets import (
    Literals,
    Words,
    as_literal,
    as_literals,
    from_words,
    to_words,
)
from neurosnap.sensorium import Sensorium, complement

if TYPE_CHECKING:
    import networkx

Ints: TypeAlias = NDArray[np.int64]
_ROWS = 256  # of a relation that are unpacked at a time
_Scalar = TypeVar("_Scalar", bound=np.generic)
WiringKind: TypeAlias = Literal["hasse", "derived"]
BEYOND_HEIGHT = 2
"""Hops that a wave may take beyond the height where sensors are equal, or nearly so:
one to the literal that stands for its class, one from that to the others of a class."""


class PocGraph:
    """A directed graph on the ``2N`` literals of ``N`` sensors ([GK] "poc graph").

    Sets of literals go in as a ``(2N,)`` bool array or as the literals, and come out
    as new ``(2N,)`` bool arrays.

    The constructor refuses a literal that is equivalent to its own complement. The
    graph of a snapshot has none as long as all readings were known, since equivalent
    literals agree in the last observation (rounding at the tolerance of discounted
    weights aside). With unknown readings, pairs known at different times can lead to
    such a class; the graph of a snapshot is not checked for it. The class then has one
    representative, which also stands for the complement, and no coherent set holds any
    of its literals; but the graph generates no poc set, and `PocSet` refuses it.

    Args:
        edges: ``(2N, 2N)`` bool; ``edges[a, b]`` iff ``a -> b``. The diagonal is
            ignored.

    Raises:
        ShapeError: `edges` is not square with an even side.
        InvalidValueError: An edge lacks its contrapositive, or a literal is equivalent
            to its own complement.

    Examples:
        >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4)])
        >>> g.leq(0, 4), g.leq(5, 1), g.height()
        (True, True, 2)
    """

    def __init__(self, edges: NDArray[np.bool_]) -> None:
        edges = np.asarray(edges)
        if edges.ndim != 2 or edges.shape[0] != edges.shape[1] or len(edges) % 2:
            raise ShapeError("edges", "must be (2N, 2N)", edges.shape)
        if edges.dtype != np.bool_:
            raise InvalidValueError("edges", "must be bool", edges.dtype)
        lone = edges & ~contraposed(edges)
        if lone.any():
            a, b = (int(k) for k in np.argwhere(lone)[0])
            rule = f"must have its contrapositive {(b ^ 1, a ^ 1)}"
            raise InvalidValueError("edge", rule, (a, b))
        edges = edges.copy()
        np.fill_diagonal(edges, False)
        self._rows = to_words(edges)
        self._groups = np.arange(len(edges))
        self.refuse_contradiction()

    @classmethod
    def from_implications(
        cls, sensors: int, implications: Iterable[tuple[int, int]]
    ) -> "PocGraph":
        """Return the graph of the given edges and their contrapositives.

        Args:
            sensors: ``N``.
            implications: Pairs of literals ``(a, b)``, each meaning ``a -> b``.

        Raises:
            InvalidValueError: `sensors` is no whole number from 0 up, an entry is no
                pair of literals, or a literal is equivalent to its own complement.

        Examples:
            >>> PocGraph.from_implications(2, [(0, 2)]).edges.nonzero()
            (array([0, 3]), array([2, 1]))
        """
        sensors = len(Sensorium.of(sensors))
        edges = np.zeros((2 * sensors, 2 * sensors), np.bool_)
        for pair in implications:
            try:
                source, target = pair
            except (TypeError, ValueError) as error:
                rule = "must be a pair of literals"
                raise InvalidValueError("implication", rule, pair) from error
            a = as_literal("implication", source, 2 * sensors)
            b = as_literal("implication", target, 2 * sensors)
            edges[a, b] = edges[b ^ 1, a ^ 1] = True
        return cls(edges)

    @classmethod
    def of_rows(cls, rows: Words, groups: Ints | None = None) -> "PocGraph":
        """Return a graph over packed edges, not copied and not checked.

        Args:
            rows: ``(n, w)``, the out-edges of groups of equivalent literals. Groups are
                numbered as literals are: the complements of group ``g`` are ``g ^ 1``.
            groups: ``(2N,)``: the group of each literal, none empty; if None, each is
                one by itself. Time and room go by the groups, but where a result is a
                matrix of all literals.
        """
        if groups is None:
            groups = np.arange(len(rows))
        graph = cls.__new__(cls)
        graph._rows, graph._groups = rows, groups  # noqa: SLF001 - its own class
        return graph

    @classmethod
    def without_edges(cls, literals: int) -> "PocGraph":
        """Return the graph in which nothing implies anything.

        It takes room for the literals alone until anything but `up` is asked for.
        """
        graph = cls.__new__(cls)
        graph._groups = np.arange(literals)  # noqa: SLF001 - its own class
        return graph

    @cached_property
    def _rows(self) -> Words:
        count = len(self._groups)
        return np.zeros((count, (count + 63) // 64), np.uint64)

    def __len__(self) -> int:
        """Return the number of literals, ``2N``."""
        return len(self._groups)

    @cached_property
    def _are_single(self) -> bool:
        """Whether each literal is a group by itself, of its own number."""
        count = len(self._rows)
        return count == len(self) and bool((self._groups == np.arange(count)).all())

    @cached_property
    def _names(self) -> Ints:
        """``(n,)``: the least literal of each group."""
        return np.unique(self._groups, return_index=True)[1]

    def _each(self, rows: Words) -> Words:
        """Return a relation of groups as one of literals."""
        return rows if self._are_single else expanded(rows, self._groups)

    @property
    def sensors(self) -> int:
        """The number of sensors, ``N``."""
        return len(self) // 2

    @cached_property
    def edges(self) -> NDArray[np.bool_]:
        """``(2N, 2N)`` bool, read-only; ``edges[a, b]`` iff ``a -> b``."""
        edges = from_words(self._each(self._rows), len(self))
        np.fill_diagonal(edges, False)
        return _frozen(edges)

    def up(self, literals: Literals) -> NDArray[np.bool_]:
        """Return everything above the literals, themselves included. O(N²/64) time."""
        given = as_literals("literals", literals, len(self))
        if "_rows" not in vars(self):  # it has no edges
            above = np.zeros(len(self), np.bool_)
            above[given] = True
            return above
        groups = np.zeros(len(self._rows), np.bool_)
        groups[self._groups[given]] = True
        reached = to_words(groups)
        kernels.spread(self._rows, reached)
        return from_words(reached, len(groups))[self._groups]

    def coherent_projection(self, literals: Literals) -> NDArray[np.bool_]:
        """Return ``up(A) - up(A)*``, always coherent ([GK] coherent projection).

        Examples:
            >>> g = PocGraph.from_implications(2, [(0, 2)])
            >>> g.coherent_projection([0]).nonzero()[0]
            array([0, 2])
            >>> g.coherent_projection([0, 3]).any()
            np.False_
        """
        above = self.up(literals)
        return above & ~complement(above)

    def propagate(self, load: Literals, signal: Literals) -> NDArray[np.bool_]:
        """Return ``(up(B) + up(T)) - up(T)*`` ([GK] defn:propagation algorithm).

        Args:
            load: ``B``, coherent: what the graph is loaded with. Coherence is not
                checked; the formula holds as it stands.
            signal: ``T``, any set.
        """
        above = self.up(signal)
        return (self.up(load) | above) & ~complement(above)

    def is_coherent(self, literals: Literals) -> bool:
        """Return whether no ``a, b`` in the set have ``a <= b*``."""
        chosen = as_literals("literals", literals, len(self))
        return not (self.up(chosen) & complement(chosen)).any()

    def leq(self, a: int, b: int) -> bool:
        """Return whether ``a <= b``. The first call works out the order."""
        low = int(self._groups[as_literal("a", a, len(self))])
        high = int(self._groups[as_literal("b", b, len(self))])
        return bool(
            self._order.closed[low, high >> 6] >> np.uint64(high & 63) & np.uint64(1)
        )

    @property
    def closed(self) -> Words:
        """``(2N, w)``, read-only: bit ``b`` of row ``a`` iff ``a <= b``.

        The first call works out the order.
        """
        return self._closed

    @cached_property
    def _closed(self) -> Words:
        return _frozen(self._each(self._order.closed))

    @property
    def groups(self) -> Ints:
        """``(2N,)``, read-only: the group of each literal, all equivalent."""
        return self._groups

    @property
    def closed_groups(self) -> Words:
        """``(n, w)``, read-only: as `closed`, of groups: O(n²/64) room."""
        return self._order.closed

    def classes(self) -> list[tuple[int, ...]]:
        """Return the classes of equivalent literals with two members or more, sorted.

        Examples:
            >>> PocGraph.from_implications(2, [(0, 2), (2, 0)]).classes()
            [(0, 2), (1, 3)]
        """
        members: dict[int, list[int]] = {}
        for literal, head in enumerate(self.representative.tolist()):
            members.setdefault(head, []).append(literal)
        return sorted(tuple(group) for group in members.values() if len(group) > 1)

    @property
    def representative(self) -> NDArray[np.int64]:
        """``(2N,)``, read-only: of each literal's class, the one of the first sensor.

        Commutes with the complement: ``representative[a ^ 1] = representative[a] ^ 1``.
        """
        return self._representative

    @cached_property
    def _representative(self) -> Ints:
        return _frozen(self._names[self._order.representative][self._groups])

    def heights(self) -> NDArray[np.int64]:
        """Return the edges on the longest chain going up from each literal.

        A chain has inequivalent literals, each below the next.

        Returns:
            ``(2N,)``, read-only.
        """
        return self._heights

    @cached_property
    def _heights(self) -> Ints:
        return _frozen(self._order.heights[self._groups])

    def height(self) -> int:
        """Return the edges on the longest chain; 0 without literals."""
        return int(self._order.heights.max(initial=0))

    def hasse(self) -> NDArray[np.bool_]:
        """Return ``wiring("hasse")``: the fewest edges with the same paths."""
        return self.wiring("hasse")

    def wiring(self, kind: WiringKind = "hasse") -> NDArray[np.bool_]:
        """Return the edges that signals travel along.

        Both kinds have the reachability of `edges` and are closed under
        contraposition. Between classes edges lead from representative to
        representative: for ``"hasse"`` the covering relation, for ``"derived"`` all
        edges of this graph. Inside a class they lead from the representative to each
        member and back.

        Nothing is more than ``height() + 2`` hops from where a signal starts: a member
        other than the representative has edges to and from its representative alone,
        so a path that repeats nothing passes such members at its ends only, one hop
        each; in between it goes up a chain of representatives.

        Returns:
            ``(2N, 2N)`` bool, read-only. Where few edges are looked at, `wire_list`
            takes far less room.

        Raises:
            InvalidValueError: Another `kind`.

        Examples:
            >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4), (0, 4)])
            >>> int(g.edges.sum()), int(g.hasse().sum())
            (6, 4)
        """
        flat = np.zeros((len(self), len(self)), np.bool_)
        flat[*_ends(self.wire_list(kind))] = True
        return _frozen(flat)

    def _wired_groups(self, kind: WiringKind) -> Words:
        """Return the edges of a wiring between groups, packed."""
        if kind not in ("hasse", "derived"):
            raise InvalidValueError("kind", 'must be "hasse" or "derived"', kind)
        edges = self._order.covers if kind == "hasse" else self._rows
        head = self._order.representative
        wires = wired(edges, head)
        if (head[1::2] != head[::2] ^ 1).any():
            plain = from_words(wires, len(wires))
            wires = to_words(plain | contraposed(plain))
        return wires

    def wire_list(self, kind: WiringKind = "hasse") -> NDArray[np.int64]:
        """Return the edges of `wiring` as ``source << 32 | target``, ascending.

        Returns:
            ``(e,)``, read-only; the same array every time.

        Examples:
            >>> g = PocGraph.from_implications(2, [(0, 2)])
            >>> [(int(e >> 32), int(e & 0xFFFFFFFF)) for e in g.wire_list()]
            [(0, 2), (3, 1)]
        """
        if kind not in self._wire_lists:
            wires = self._wired_groups(kind)
            edges = kernels.pairs(wires, int(np.bitwise_count(wires).sum()))
            if not self._are_single:
                edges = self._with_members(edges)
            self._wire_lists[kind] = _frozen(edges)
        return self._wire_lists[kind]

    def _with_members(self, edges: Ints) -> Ints:
        """Return a list of edges between groups with those of all of their literals."""
        ends = self._names[np.stack(_ends(edges))]
        head = self.representative
        rest = np.flatnonzero(self._names[self._groups] != np.arange(len(self)))
        # Both ways between a literal and what stands for it.
        stars = np.stack((head[rest], rest))
        every = [ends, stars, stars[::-1]]
        if (head[1::2] != head[::2] ^ 1).any():
            every += [stars[::-1] ^ 1, stars ^ 1]
        sources, targets = np.hstack(every)
        found = np.sort(sources << 32 | targets, kind="stable")
        once: Ints = found[np.diff(found, prepend=-1) > 0]
        return once

    def depth(self, signal: Literals, kind: WiringKind = "hasse") -> int:
        """Return the hops over a wiring until the last of ``up(signal)`` is reached.

        Returns:
            At most ``height() + BEYOND_HEIGHT``; any literal is 0 hops from itself.

        Raises:
            InvalidValueError: Another `kind`, or an entry that is no literal.

        Examples:
            >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4), (0, 4)])
            >>> g.depth([0]), g.depth([0], "derived")
            (2, 1)
        """
        reached = to_words(as_literals("signal", signal, len(self)))
        return int(kernels.spread(to_words(self.wiring(kind)), reached))

    def implications(self, sensorium: Sensorium) -> list[tuple[str, str]]:
        """Return the edges of `hasse` by name, one of each contrapositive pair.

        Of ``a -> b`` and ``b* -> a*`` it is the one with the smaller source; they are
        sorted by their literals.

        Raises:
            ShapeError: `sensorium` has another number of sensors.

        Examples:
            >>> g = PocGraph.from_implications(2, [(0, 2)])
            >>> g.implications(Sensorium(["door", "motion"]))
            [('door', 'motion')]
        """
        self.check_names(sensorium)
        pairs = np.transpose(_ends(self.wire_list())).tolist()
        return [(sensorium.name(a), sensorium.name(b)) for a, b in pairs if a <= b ^ 1]

    def to_networkx(
        self, sensorium: Sensorium, kind: WiringKind = "hasse"
    ) -> "networkx.DiGraph[str]":
        """Return the edges of `wiring` as a graph of networkx, literals by name.

        Raises:
            ShapeError: `sensorium` has another number of sensors.
            ImportError: networkx is not installed; the extra `export` brings it.

        Examples:
            >>> g = PocGraph.from_implications(2, [(0, 2)])
            >>> list(g.to_networkx(Sensorium(["door", "motion"])).edges)
            [('door', 'motion'), ('motion*', 'door*')]
        """
        import networkx

        self.check_names(sensorium)
        graph: networkx.DiGraph[str] = networkx.DiGraph()
        graph.add_nodes_from(map(sensorium.name, range(len(self))))
        graph.add_edges_from(
            (sensorium.name(a), sensorium.name(b))
            for a, b in np.transpose(_ends(self.wire_list(kind))).tolist()
        )
        return graph

    def check_names(self, sensorium: Sensorium) -> None:
        """Raise ShapeError for names of another number of sensors."""
        if len(sensorium) != self.sensors:
            rule = f"must have {self.sensors} sensors"
            raise ShapeError("sensorium", rule, len(sensorium))

    @cached_property
    def _order(self) -> Order:
        """What follows from the edges."""
        return order_of(self._rows, self._names)

    @cached_property
    def _wire_lists(self) -> dict[str, Ints]:
        """The wirings asked for so far."""
        return {}

    def refuse_contradiction(self) -> None:
        """Raise InvalidValueError if a literal is equivalent to its own complement."""
        both = (self.representative[::2] == self.representative[1::2]).nonzero()[0]
        if both.size:
            rule = "must not be equivalent to its own complement"
            raise InvalidValueError("literal", rule, int(2 * both[0]))


def _ends(edges: Ints) -> tuple[Ints, Ints]:
    """Return where the edges of `PocGraph.wire_list` begin, and where they end."""
    return edges >> 32, edges & 0xFFFFFFFF


def expanded(rows: Words, groups: Ints, *, equal: bool = True) -> Words:
    """Return a relation of groups of literals as one of the literals.

    Args:
        rows: ``(n, w)``, packed.
        groups: ``(m,)``, the group of each literal.
        equal: Whether the literals of a group are related, each way.

    Returns:
        ``(m, ceil(m / 64))``, no bit on the diagonal but those of the groups.
    """
    wide = np.empty((len(rows), (len(groups) + 63) // 64), np.uint64)
    for start in range(0, len(rows), _ROWS):
        some = from_words(rows[start : start + _ROWS], len(rows))
        if equal:
            some[np.arange(len(some)), np.arange(start, start + len(some))] = True
        wide[start : start + _ROWS] = to_words(some[:, groups])
    return wide[groups]


def contraposed(edges: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the contrapositives of edges: ``result[a, b] = edges[b*, a*]``."""
    sensors = len(edges) // 2
    squares = edges.reshape(sensors, 2, sensors, 2)[:, ::-1, :, ::-1]
    return squares.reshape(edges.shape).T


def _frozen(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return the array, read-only from now on."""
    array.flags.writeable = False
    return array
