"""Simplicial complexes, as complexes of cells."""

import itertools
from collections.abc import Iterable

from neurosnap.poc.dual.homology import CellComplex


def simplicial(simplices: Iterable[Iterable[int]]) -> CellComplex:
    """Return the simplices, each a set of whole numbers, with all their faces."""
    layers: dict[int, set[tuple[int, ...]]] = {}
    for simplex in simplices:
        points = tuple(sorted(set(simplex)))
        for size in range(1, len(points) + 1):
            layer = layers.setdefault(size, set())
            layer.update(itertools.combinations(points, size))
    boundaries: list[list[tuple[int, ...]]] = []
    numbers: dict[tuple[int, ...], int] = {}
    for size in range(1, len(layers) + 1):
        ordered = sorted(layers[size])
        faces = range(size) if size > 1 else ()
        boundaries.append(
            [tuple(numbers[one[:k] + one[k + 1 :]] for k in faces) for one in ordered]
        )
        numbers = {cell: k for k, cell in enumerate(ordered)}
    return CellComplex(boundaries)
