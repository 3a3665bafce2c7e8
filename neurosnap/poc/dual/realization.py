"""Readings of sensors at each point of a space, and the states that occur there.

Every point shows one complete *-selection. Those that are coherent are the vertices
of the model space that can be met with; the others exist only in the model, and
leaving them out gives the punctured dual, which may have the holes of the space where
the dual has none.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import Literals, as_literals, members, to_mask
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium, complete


class Realization:
    """The points of a finite set at which each sensor is on ([GK] realization).

    Args:
        rows: One field a sensor: ``(points,)`` bits, where it is on.
        sensors: Their names; ``s0``, ``s1``, and so on without them.

    Raises:
        ShapeError: Fields have unequal lengths, there is no point, or not one name a
            field.
        InvalidValueError: An entry is not 0 or 1.

    Examples:
        >>> r = Realization([[1, 0, 0], [0, 0, 1]], ["a", "b"])
        >>> r.poc_set(), len(r.vertices())
        (PocSet.parse('a, b : a < b*'), 3)
    """

    def __init__(
        self,
        rows: Iterable[ArrayLike],
        sensors: Iterable[str] | Sensorium | None = None,
    ) -> None:
        if isinstance(rows, str):
            raise InvalidValueError("fields", "must be one row of bits a sensor", rows)
        listed = [np.asarray(row) for row in rows]
        if not isinstance(sensors, Sensorium):
            sensors = (
                Sensorium.of(len(listed)) if sensors is None else Sensorium(sensors)
            )
        if len(sensors) != len(listed):
            raise ShapeError(
                "fields", f"must be {len(sensors)}, one a sensor", len(listed)
            )
        self._sensorium = sensors
        self._fields = self._checked_fields(listed)
        self._fields.flags.writeable = False

    def _checked_fields(self, rows: list[NDArray[Any]]) -> NDArray[np.bool_]:
        """Return fields of equal length as one array."""
        points = len(rows[0]) if rows and rows[0].ndim == 1 else 0
        fields = np.zeros((len(rows), points), np.bool_)
        for row, field, sensor in zip(rows, fields, self._sensorium, strict=True):
            name = f"field of {sensor}"
            if row.shape != field.shape:
                rule = f"must have {points} points as the first has"
                raise ShapeError(name, rule, row.shape)
            if row.dtype.kind not in "biuf" or not np.isin(row, (0, 1)).all():
                rule = "must be made of bits, 0 or 1"
                raise InvalidValueError(name, rule, row.tolist())
            field[:] = row == 1
        if rows and not points:
            raise ShapeError("fields", "must be over at least one point", fields.shape)
        return fields

    @property
    def fields(self) -> NDArray[np.bool_]:
        """``(N, points)`` bool, read-only: where each sensor is on."""
        return self._fields

    @property
    def sensorium(self) -> Sensorium:
        """The sensors' names."""
        return self._sensorium

    def poc_set(self) -> PocSet:
        """Return the order of the fields by inclusion.

        ``a <= b`` iff `a` is on nowhere that `b` is off; a sensor that is on nowhere
        is negligible, sensors with the same field are one element.
        """
        return PocSet.from_graph(PocGraph(inclusions(self._fields)), self._sensorium)

    def vertex(self, point: int) -> NDArray[np.bool_]:
        """Return what a point shows: ``(2N,)`` bool, a complete *-selection.

        Raises:
            InvalidValueError: There is no such point.
        """
        count = self._fields.shape[1]
        if isinstance(point, bool) or point not in range(count):
            rule = f"must be the number of one of {count} points"
            raise InvalidValueError("point", rule, point)
        return complete(self._fields[:, point])

    def vertices(self, poc: PocSet | None = None) -> list[NDArray[np.bool_]]:
        """Return the consistent vertices ([GK] defn:consistent vertices).

        Args:
            poc: Whose dual they are of; `poc_set` without it. What a point shows is
                left out where that is not coherent, which happens only if the fields
                break a relation.

        Returns:
            ``(2N,)`` bool each, in the order of their first points.
        """
        order = self._checked(self.poc_set() if poc is None else poc)
        shown = np.unique(self._fields, axis=1, return_index=True)[1]
        selections = [complete(self._fields[:, x]) for x in sorted(shown.tolist())]
        return [u for u in selections if order.is_coherent(u)]

    def witnesses(self, literals: Literals) -> NDArray[np.bool_]:
        """Return the points at which all of some literals are on: ``(points,)`` bool.

        With a vertex these are its witnesses, with the literals that the vertices of
        a cube share those of the cube.
        """
        total = 2 * len(self._sensorium)
        chosen = as_literals("literals", literals, total)
        shown = self._fields[chosen[::2]].all(axis=0)
        hidden = ~self._fields[chosen[1::2]].any(axis=0)
        return np.asarray(shown & hidden, np.bool_)

    def punctured(self, poc: PocSet | None = None) -> list[tuple[int, ...]]:
        """Return the punctured dual: the cubes all of whose vertices are consistent.

        [GK] defn:punctured dual. Equal sensors are one direction. A cube of dimension
        ``d`` has ``2**d`` vertices and ``3**d`` faces, which are all listed.

        Args:
            poc: As for `vertices`.

        Returns:
            Each cube once, by rising dimension, as the numbers of its vertices in the
            list of `vertices`. Each bit of a place in it is a direction: the vertex at
            place ``p`` is off, and that at place 0 on, in the directions that ``p``
            has. O(N) time and one place in memory for each vertex of each cube.

        Examples:
            >>> Realization([[1, 1, 0], [1, 0, 1]]).punctured()
            [(0,), (1,), (2,), (0, 2), (0, 1)]
        """
        order = self.poc_set() if poc is None else poc
        vertices = self.vertices(order)
        directions = [a for a in order.heads.tolist() if not a & 1]
        corners = [to_mask(vertex[directions]) for vertex in vertices]
        numbers = {corner: number for number, corner in enumerate(corners)}
        # Each with the directions in which it may still grow: its first vertex is on
        # there, and they come after its own, so that each cube is found once.
        cubes: list[tuple[tuple[int, ...], int]] = [
            ((number,), corner) for corner, number in numbers.items()
        ]
        for cube, ahead in cubes:
            for k in members(ahead):
                across = [numbers.get(corners[v] ^ 1 << k) for v in cube]
                parallel = tuple(v for v in across if v is not None)
                if len(parallel) == len(cube):
                    cubes.append((cube + parallel, ahead >> k + 1 << k + 1))
        return [cube for cube, _ in cubes]

    def __repr__(self) -> str:
        sensors, points = self._fields.shape
        return f"Realization({sensors} sensors over {points} points)"

    def _checked(self, poc: PocSet) -> PocSet:
        """Return `poc` if it is on the same sensors."""
        if poc.sensorium != self._sensorium:
            names = list(self._sensorium.names)
            raise InvalidValueError("poc set", f"must be on {names}", str(poc))
        return poc


def inclusions(fields: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which fields, of ``(N, points)`` bool, are in which others.

    Returns:
        ``(2N, 2N)`` bool; true at ``[a, b]`` iff the field of `a` is in that of `b`.

    Examples:
        >>> inclusions(np.array([[True, False], [True, True]]))[0, 2]
        np.True_
    """
    sensors, points = fields.shape
    literals = np.stack([fields, ~fields], axis=1).reshape(2 * sensors, points)
    # Sums of zeros and ones: at least one cannot round to none.
    outside = literals.astype(np.float32) @ (~literals).astype(np.float32).T
    return np.asarray(outside == 0, np.bool_)
