"""The order of implication on sensors and their complements.

The elements of a poc set on ``N`` sensors are its ``2N`` literals and two more: the
minimum, number ``2N``, and the maximum, number ``2N + 1``, so that ``^ 1`` is the
complement of every element. They are always there and never among the sensors.
Literals below each other are one element: whatever counts elements counts such a
class once, by its representative.

An order can be read from implications such as "a < b*". It must keep every literal
apart from its own complement, and a strict relation must stay strict: what breaks that
is refused ([GK] example:generators and relations).
"""

import re
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import Literals, as_literal, as_literals
from neurosnap.sensorium import Sensorium, complement

Element: TypeAlias = int | str
"""An element by its number, or a literal by its name."""
Sign: TypeAlias = Literal["<", "<=", "="]
RelationLike: TypeAlias = (
    tuple[int | str, int | str] | tuple[int | str, str, int | str] | str
)
"""``(a, b)`` for ``a <= b``, ``(a, sign, b)``, or text such as ``"a < b <= c*"``."""
_SIGNS: dict[str, Sign] = {"<": "<", "<=": "<=", "≤": "<=", "=": "="}
_SPLIT = re.compile(r"(<=|≤|<|=)")
OrderRelation: TypeAlias = tuple[int, Sign, int]
"""Two literals, and between them ``"<"`` (below, and not equal), ``"<="`` or ``"="``.
"""


class PocSet:
    """A weak poc set ([GK] defn:poc set), as an order on the literals of sensors.

    Sets of literals go in as a ``(2N,)`` bool array or as the literals' numbers, and
    come out as new ``(2N,)`` bool arrays.

    Args:
        sensors: The generators: names, how many, or a sensorium.
        relations: Pairs ``(a, b)`` meaning ``a <= b``, triples ``(a, sign, b)`` with
            a sign of ``<``, ``<=`` or ``=``, or text such as ``"a < b*"``; literals by
            name or number. What follows from them holds too, and no more.

    Raises:
        UnknownSensorError: A relation is about no literal of these sensors.
        InvalidValueError: A name or a relation is malformed, a strict relation closes
            a cycle, or a literal becomes equal to its complement: that is named.

    Examples:
        >>> p = PocSet(["a", "b", "c"], [("a", "<", "c*"), ("b", "<", "c*")])
        >>> p.leq("c", "a*"), p.crosses("a", "b"), p.height()
        (True, True, 1)
    """

    def __init__(
        self,
        sensors: int | Iterable[str] | Sensorium,
        relations: Iterable[RelationLike] = (),
    ) -> None:
        if isinstance(sensors, Sensorium):
            self._sensorium = sensors
        elif isinstance(sensors, int | np.integer):
            self._sensorium = Sensorium.of(sensors)
        else:
            self._sensorium = Sensorium(sensors)
        read = _read_relations(self._sensorium, relations)
        self._graph = generated(self._sensorium, read)

    @classmethod
    def parse(cls, text: str) -> "PocSet":
        """Return the poc set of ``"generators : relations"``.

        Args:
            text: Names with commas between, then a colon and relations with commas
                between: literals joined by ``<``, ``<=`` (also ``≤``) or ``=``, as
                many in a chain as liked. Without relations the colon may be missing.

        Raises:
            UnknownSensorError: A relation is about no generator.
            InvalidValueError: As for the class.

        Examples:
            >>> PocSet.parse("a, b, c : a < b <= c*")
            PocSet.parse('a, b, c : a < b, b < c*')
        """
        sensorium, relations = _split_text(text)
        return cls(sensorium, relations)

    @classmethod
    def from_graph(
        cls, graph: PocGraph, sensorium: Sensorium | None = None
    ) -> "PocSet":
        """Return the poc set that a graph generates ([GK] defn:derived poc set).

        Args:
            graph: Its paths are the order.
            sensorium: The names; ``s0``, ``s1``, and so on without them.

        Raises:
            ShapeError: `sensorium` has another number of sensors.
            InvalidValueError: A literal is equivalent to its own complement, as it
                may be in the graph of a snapshot with unknown readings.
        """
        if not isinstance(graph, PocGraph):
            raise InvalidValueError("graph", "must be a PocGraph", graph)
        graph.refuse_contradiction()
        if sensorium is None:
            sensorium = Sensorium.of(graph.sensors)
        graph.check_names(sensorium)
        new = cls.__new__(cls)
        new._sensorium = sensorium  # noqa: SLF001 - its own class
        new._graph = graph  # noqa: SLF001 - its own class
        return new

    @property
    def graph(self) -> PocGraph:
        """A graph whose paths are the order."""
        return self._graph

    @property
    def sensorium(self) -> Sensorium:
        """The generators' names."""
        return self._sensorium

    @property
    def minimum(self) -> int:
        """The number of the minimum, ``2N``."""
        return 2 * len(self._sensorium)

    @property
    def maximum(self) -> int:
        """The number of the maximum, ``2N + 1``."""
        return self.minimum + 1

    @cached_property
    def order(self) -> NDArray[np.bool_]:
        """``(2N, 2N)`` bool, read-only; ``order[a, b]`` iff ``a <= b``."""
        above = [self._graph.up([a]) for a in range(self.minimum)]
        order = np.array(above, np.bool_).reshape(self.minimum, self.minimum)
        order.flags.writeable = False
        return order

    def element(self, name: Element) -> int:
        """Return the number of an element given by its name or its number.

        Raises:
            UnknownSensorError: No sensor has that name.
            InvalidValueError: No element has that number.
        """
        if isinstance(name, str):
            return _element(self._sensorium, name)
        return as_literal("element", name, self.minimum + 2)

    def name(self, number: int) -> str:
        """Return the name of an element; ``"0"`` and ``"1"`` for the bounds."""
        if number in (self.minimum, self.maximum):
            return str(number - self.minimum)
        return self._sensorium.name(number)

    def leq(self, a: Element, b: Element) -> bool:
        """Return whether ``a <= b``.

        Examples:
            >>> p = PocSet.parse("a, b : a < b")
            >>> p.leq("b*", "a*"), p.leq("b", p.maximum), p.leq(p.minimum, "a")
            (True, True, True)
        """
        low, high = self.element(a), self.element(b)
        if low == self.minimum or high == self.maximum:
            return True
        if low == self.maximum or high == self.minimum:
            return False
        return self._graph.leq(low, high)

    def equal(self, a: Element, b: Element) -> bool:
        """Return whether two literals are one element."""
        return self.leq(a, b) and self.leq(b, a)

    @cached_property
    def negligible(self) -> NDArray[np.bool_]:
        """``(2N,)`` bool, read-only: the literals ``a`` with ``a <= a*``."""
        literals = np.arange(self.minimum)
        below: NDArray[np.bool_] = self.order[literals, literals ^ 1]
        below.flags.writeable = False
        return below

    @property
    def ubiquitous(self) -> NDArray[np.bool_]:
        """``(2N,)`` bool: the complements of the negligible literals."""
        return complement(self.negligible)

    @property
    def proper(self) -> NDArray[np.bool_]:
        """``(2N,)`` bool: the literals neither negligible nor ubiquitous."""
        return ~(self.negligible | self.ubiquitous)

    @cached_property
    def heads(self) -> NDArray[np.int64]:
        """One literal of each proper element, ascending; read-only.

        ``a`` is among them iff ``a ^ 1`` is.
        """
        first = self._graph.representative == np.arange(self.minimum)
        heads = np.flatnonzero(first & self.proper)
        heads.flags.writeable = False
        return heads

    def nested(self, a: Element, b: Element) -> bool:
        """Return whether one of ``a``, ``a*`` is below one of ``b``, ``b*``.

        [GK] defn:nesting says so of proper elements; a literal that is not is nested
        with every other, as its image in the canonical quotient is.
        """
        return not self.crosses(a, b)

    def crosses(self, a: Element, b: Element) -> bool:
        """Return whether both are proper and no relation holds between them.

        Examples:
            >>> p = PocSet.parse("a, b, c : a < b")
            >>> p.crosses("a", "b*"), p.crosses("a", "c"), p.crosses("a", "a*")
            (False, True, False)
        """
        x, y = self.element(a), self.element(b)
        if x >= self.minimum or y >= self.minimum:
            return False
        if self.negligible[[x, x ^ 1, y, y ^ 1]].any():
            return False
        return not self.order[np.ix_([x, x ^ 1], [y, y ^ 1])].any()

    def is_coherent(self, literals: Literals) -> bool:
        """Return whether no ``a, b`` in it have ``a <= b*`` ([GK] defn:coherence)."""
        return self._graph.is_coherent(literals)

    def clash(self, literals: Literals) -> tuple[str, str] | None:
        """Return a pair that makes a set incoherent, by name: ``a <= b`` with b* in it.

        Examples:
            >>> PocSet.parse("a, b : a < b").clash([0, 3])
            ('a', 'b')
        """
        chosen = as_literals("literals", literals, self.minimum)
        against = complement(chosen)
        for a in np.flatnonzero(chosen).tolist():
            hit = np.flatnonzero(self.order[a] & against)
            if hit.size:
                return self.name(a), self.name(int(hit[0]))
        return None

    def hasse(self) -> list[tuple[int, int]]:
        """Return pairs of representatives ``(a, b)``, `a` directly below `b`, sorted.

        The bounds are left out.

        Examples:
            >>> PocSet.parse("a, b : a < b").hasse()
            [(0, 2), (3, 1)]
        """
        head = self._graph.representative
        edges = self._graph.hasse()[head == np.arange(self.minimum)]
        heads = np.unique(head)
        low, high = edges[:, heads].nonzero()
        return sorted(zip(heads[low].tolist(), heads[high].tolist(), strict=True))

    def height(self) -> int:
        """Return the edges on the longest chain of literals, the bounds not counted.

        With minimum and maximum the chain is two edges longer.
        """
        return self._graph.height()

    def restricted(self, sensors: Iterable[str]) -> "PocSet":
        """Return the order among some of the sensors: the poc subset they induce.

        Raises:
            UnknownSensorError: A name is not among the sensors.

        Examples:
            >>> PocSet.parse("a, b, c : a < b < c").restricted(["a", "c"])
            PocSet.parse('a, c : a < c')
        """
        names = Sensorium(sensors)
        kept = [self._sensorium.literal(name) + k for name in names for k in (0, 1)]
        return PocSet.from_graph(PocGraph(self.order[np.ix_(kept, kept)]), names)

    def direct_sum(self, other: "PocSet") -> "PocSet":
        """Return the two side by side, every element of one crossing the other's.

        The dual of the sum is the product of the duals ([GK] defn:direct sum).

        Raises:
            InvalidValueError: Both have a sensor of the same name.

        Examples:
            >>> PocSet.parse("a, b : a < b") | PocSet.parse("c")
            PocSet.parse('a, b, c : a < b')
        """
        if not isinstance(other, PocSet):
            raise InvalidValueError("summand", "must be a PocSet", other)
        shared = set(self._sensorium) & set(other.sensorium)
        if shared:
            rule = "must not be in both summands"
            raise InvalidValueError("sensor name", rule, min(shared))
        here, total = self.minimum, self.minimum + other.minimum
        edges = np.zeros((total, total), np.bool_)
        edges[:here, :here] = self._graph.edges
        edges[here:, here:] = other.graph.edges
        names = Sensorium([*self._sensorium, *other.sensorium])
        return PocSet.from_graph(PocGraph(edges), names)

    def __or__(self, other: "PocSet") -> "PocSet":
        return self.direct_sum(other)

    def __len__(self) -> int:
        """Return the number of sensors, ``N``."""
        return len(self._sensorium)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PocSet):
            return NotImplemented
        same = self._sensorium == other.sensorium
        return same and bool((self.order == other.order).all())

    def __hash__(self) -> int:
        return hash((self._sensorium, self.order.tobytes()))

    def __repr__(self) -> str:
        return f"PocSet.parse({str(self)!r})"

    def __str__(self) -> str:
        """Return generators and relations, of each contrapositive pair the plainer."""
        relations = [
            f"{self.name(a)} < {self.name(b)}"
            for a, b in self.hasse()
            if ((a & 1) + (b & 1), a) <= ((b & 1 ^ 1) + (a & 1 ^ 1), b ^ 1)
        ]
        for literals in self._graph.classes():
            head, *others = literals
            if not head & 1:
                relations += [f"{self.name(head)} = {self.name(b)}" for b in others]
        names = ", ".join(self._sensorium)
        return f"{names} : {', '.join(relations)}" if relations else names


def _split_text(text: object) -> tuple[Sensorium, list[str]]:
    """Return the generators and the relations of ``"a, b : a < b"``, still as text."""
    if not isinstance(text, str):
        raise InvalidValueError("poc set", 'must be text such as "a, b : a < b"', text)
    before, _, after = text.partition(":")
    names = [name.strip() for name in before.split(",")] if before.strip() else []
    for name in names:
        if _SPLIT.search(name):
            rule = "must hold no <, ≤ or =; relations follow a colon"
            raise InvalidValueError("generator", rule, name)
    return Sensorium(names), [part.strip() for part in after.split(",") if part.strip()]


def _read_relations(
    sensorium: Sensorium, relations: Iterable[RelationLike]
) -> list[OrderRelation]:
    """Return relations with their literals as numbers; of a chain one for each sign."""
    if isinstance(relations, str):
        rule = "must be several, not one text; PocSet.parse reads one"
        raise InvalidValueError("relations", rule, relations)
    found: list[OrderRelation] = []
    for entry in relations:
        for low, sign, high in _parts(entry):
            if sign not in _SIGNS:
                raise InvalidValueError("relation sign", "must be <, <= or =", sign)
            pair = _element(sensorium, low), _element(sensorium, high)
            found.append((pair[0], _SIGNS[sign], pair[1]))
    return found


def _element(sensorium: Sensorium, name: int | str) -> int:
    """Return a literal that is given by its name or its number."""
    if isinstance(name, str):
        return sensorium.literal(name)
    return as_literal("literal", name, 2 * len(sensorium))


def generated(sensorium: Sensorium, relations: Sequence[OrderRelation]) -> PocGraph:
    """Return the graph of relations; refuse those that contradict each other.

    O(N³/16) time, for the closure.
    """
    pairs = [(low, high) for low, _, high in relations]
    pairs += [(high, low) for low, sign, high in relations if sign == "="]
    try:
        graph = PocGraph.from_implications(len(sensorium), pairs)
    except InvalidValueError as error:
        if not isinstance(error.value, int | np.integer):
            raise
        rule = "must not make a literal equal to its complement"
        name = sensorium.name(int(error.value))
        raise InvalidValueError("relations", rule, name) from error
    for low, sign, high in relations:
        if sign == "<" and graph.leq(high, low):
            shown = f"{sensorium.name(low)} < {sensorium.name(high)}"
            rule = "must have no cycle through a strict one"
            raise InvalidValueError("relations", rule, shown)
    return graph


def _parts(entry: RelationLike) -> list[tuple[int | str, str, int | str]]:
    """Return the relations of one entry as triples."""
    if isinstance(entry, str):
        pieces = [piece.strip() for piece in _SPLIT.split(entry)]
        if len(pieces) < 3 or not all(pieces):
            rule = "must be literals joined by <, <= or ="
            raise InvalidValueError("relation", rule, entry)
        return [
            (pieces[k], pieces[k + 1], pieces[k + 2])
            for k in range(0, len(pieces) - 2, 2)
        ]
    try:
        given: tuple[int | str, ...] = tuple(entry)
    except TypeError:
        given = ()
    if len(given) == 2:
        return [(given[0], "<=", given[1])]
    if len(given) == 3:
        return [(given[0], str(given[1]), given[2])]
    raise InvalidValueError("relation", "must be (a, b), (a, sign, b) or text", entry)
