"""Counts the holes of a space made of cells (homology over two elements).

A complex is, for every dimension, a list of cells and for each cell the numbers of its
faces one dimension lower: enough for Betti numbers, whatever the cells are. Boundaries
are columns of bits, one whole number each, so that adding two columns is one exclusive
or.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.literal_sets import members, to_mask


class CellComplex:
    """A finite complex of cells with boundaries over GF(2).

    Args:
        boundaries: ``boundaries[d][k]`` are the faces of cell ``k`` of dimension
            ``d``, as numbers of cells of dimension ``d - 1``; none for vertices.

    Raises:
        InvalidValueError: A face does not exist, or the boundary of a boundary is not
            zero.

    Examples:
        >>> CellComplex([[()] * 3, [(0, 1), (1, 2), (0, 2)]]).betti_numbers()
        (1, 1)
    """

    def __init__(self, boundaries: Sequence[Sequence[Iterable[int]]]) -> None:
        self._columns: list[list[int]] = []
        sizes = [len(cells) for cells in boundaries]
        for dimension, cells in enumerate(boundaries):
            below = sizes[dimension - 1] if dimension else 0
            self._columns.append([_column(faces, dimension, below) for faces in cells])
        for lower, upper in itertools.pairwise(self._columns):
            for number, column in enumerate(upper):
                if _added(lower, column):
                    rule = "must have a boundary without boundary"
                    raise InvalidValueError("cell", rule, number)

    @classmethod
    def cubical(cls, corners: NDArray[np.bool_]) -> "CellComplex":
        """Return the cubes all of whose vertices are among some corners of a cube.

        This is the subcomplex that a set of vertices induces ([GK] defn:punctured
        dual); with all vertices of a dual it is the dual.

        Args:
            corners: ``(vertices, n)`` bool, one corner of the ``n``-cube a row;
                repeated rows count once.

        Examples:
            >>> CellComplex.cubical(np.array([[0, 0], [0, 1], [1, 0]], bool))
            CellComplex(vertices=3, edges=2)
        """
        return cls(list(_layers(corners)))

    def face_vector(self) -> tuple[int, ...]:
        """Return the number of cells of each dimension."""
        return tuple(len(columns) for columns in self._columns)

    def betti_numbers(self) -> tuple[int, ...]:
        """Return the dimensions of the homology groups over GF(2).

        From the top down: a cell that pairs with one above it is a boundary, so its
        own column needs no reducing. O(cells³/64) time at worst.

        Returns:
            One number a dimension of the complex; none for the empty complex. For a
            graph they are its components and its independent cycles.
        """
        ranks = [0] * (len(self._columns) + 1)
        cleared: set[int] = set()
        for dimension in range(len(self._columns) - 1, 0, -1):
            columns = self._columns[dimension]
            kept = (c for k, c in enumerate(columns) if k not in cleared)
            cleared = _pivots(kept)
            ranks[dimension] = len(cleared)
        return tuple(
            len(columns) - ranks[d] - ranks[d + 1]
            for d, columns in enumerate(self._columns)
        )

    def __repr__(self) -> str:
        words = ["vertices", "edges", "squares", "cubes"]
        named = itertools.zip_longest(words, self.face_vector())
        shown = [
            f"{word or f'dim{d}'}={count}"
            for d, (word, count) in enumerate(named)
            if count is not None
        ]
        return f"CellComplex({', '.join(shown)})"


def _layers(corners: NDArray[np.bool_]) -> Iterator[list[tuple[int, ...]]]:
    """Yield the faces of the cubes of each dimension.

    A cube is its corner with the most bits on and the directions it extends in.
    """
    corners = np.asarray(corners)
    if corners.ndim != 2:
        raise ShapeError("corners", "must be (vertices, n)", corners.shape)
    if corners.dtype != np.bool_:
        raise InvalidValueError("corners", "must be bool", corners.dtype)
    vertices = sorted({to_mask(row) for row in corners})
    cells = {(vertex, 0): number for number, vertex in enumerate(vertices)}
    faces: list[tuple[int, ...]] = [()] * len(vertices)
    while cells:
        yield faces
        cells, faces = _thickened(cells)


def _column(faces: Iterable[int], dimension: int, below: int) -> int:
    """Return a boundary as bits; a face that is there twice is not there."""
    column = 0
    for face in faces:
        if not 0 <= face < below:
            rule = f"must be in [0, {below}), the cells of dimension {dimension - 1}"
            raise InvalidValueError("face", rule, face)
        column ^= 1 << face
    return column


def _added(columns: Sequence[int], chosen: int) -> int:
    """Return the sum of the columns that the bits of `chosen` choose."""
    total = 0
    for number in members(chosen):
        total ^= columns[number]
    return total


def _pivots(columns: Iterable[int]) -> set[int]:
    """Return the highest bits of the columns once they are independent."""
    by_pivot: dict[int, int] = {}
    for given in columns:
        column = given
        while column:
            pivot = column.bit_length() - 1
            if pivot not in by_pivot:
                by_pivot[pivot] = column
                break
            column ^= by_pivot[pivot]
    return set(by_pivot)


def _thickened(
    cells: dict[tuple[int, int], int],
) -> tuple[dict[tuple[int, int], int], list[tuple[int, ...]]]:
    """Return the cubes one dimension up: two parallel ones, and all between them."""
    directions: dict[int, list[int]] = {}
    for corner, spanned in cells:
        directions.setdefault(spanned, []).append(corner)
    found: dict[tuple[int, int], int] = {}
    faces: list[tuple[int, ...]] = []
    for spanned, corners in directions.items():
        for corner in corners:
            # Directions are added from the lowest up, so each cube is found once.
            candidates = corner & ~((1 << spanned.bit_length()) - 1)
            for direction in members(candidates):
                way = 1 << direction
                if (corner ^ way, spanned) in cells:
                    found[corner, spanned | way] = len(faces)
                    faces.append(_faces(corner, spanned | way, cells))
    return found, faces


def _faces(
    corner: int, spanned: int, cells: dict[tuple[int, int], int]
) -> tuple[int, ...]:
    """Return the numbers of a cube's two faces in each of its directions."""
    faces: list[int] = []
    for direction in members(spanned):
        way = 1 << direction
        faces += [cells[corner, spanned ^ way], cells[corner ^ way, spanned ^ way]]
    return tuple(faces)
