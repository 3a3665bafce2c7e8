"""The order and the dual of a model as data, for other programs: no picture of it."""

import msgspec
import numpy as np

from neurosnap.apps.drawing.model import Model, Vertex
from neurosnap.poc.dual.homology import cubes_among
from neurosnap.poc.dual.realization import corners
from neurosnap.poc.order.pocset import PocSet


class Dual(msgspec.Struct, frozen=True):
    """A listed dual; elements and vertices are numbered from 0."""

    vertices: tuple[str, ...]
    """A vertex is a 1 or 0 for each element: whether it is on there."""
    cubes: tuple[tuple[tuple[int, ...], ...], ...]
    """The cubes of dimension 1 (edges), 2 and so on. A cube is the vertex at which all
    elements that it crosses are on, and then these elements."""
    witnessed: tuple[int, ...] | None
    """The vertices that a point or an observation shows; null if none was asked."""
    possible: tuple[int, ...] | None
    """The vertices that hold the current state; null without one."""


class Structure(msgspec.Struct, frozen=True):
    """What is drawn of a model, by names of literals."""

    elements: tuple[tuple[str, ...], ...]
    """The proper elements, complements left out: literals that are equal are one."""
    negligible: tuple[str, ...]
    """The literals that are on nowhere."""
    order: tuple[tuple[str, str], ...]
    """The edges of the Hasse diagram, the lower end first."""
    dual: Dual | None
    """Null if it has too many vertices to be listed."""


def structure(model: Model) -> Structure:
    """Return the order and the dual of a model.

    Takes as long as to list its cubes.

    Raises:
        InvalidValueError: Its dual is too large to list, and may not be left out.
    """
    poc = model.poc
    heads = [a for a in poc.heads.tolist() if not a & 1]
    same = poc.graph.representative
    return Structure(
        elements=tuple(
            tuple(poc.name(b) for b in np.flatnonzero(same == a).tolist())
            for a in heads
        ),
        negligible=tuple(poc.name(a) for a in np.flatnonzero(poc.negligible).tolist()),
        order=tuple((poc.name(a), poc.name(b)) for a, b in poc.hasse()),
        dual=None if model.vertices is None else _dual(model, model.vertices),
    )


def _dual(model: Model, vertices: list[Vertex]) -> Dual:
    rows = corners(model.poc, vertices)
    number = {row.tobytes(): k for k, row in enumerate(rows)}
    cubes: list[list[tuple[int, ...]]] = []
    for corner, spanned in cubes_among(rows):
        ways = np.flatnonzero(spanned).tolist()
        if len(ways) > len(cubes):
            cubes.append([])
        if ways:
            cubes[len(ways) - 1].append((number[corner.tobytes()], *ways))
    return Dual(
        vertices=tuple("".join("01"[bit] for bit in row.tolist()) for row in rows),
        cubes=tuple(tuple(sorted(each)) for each in cubes),
        witnessed=_numbers(model.poc, number, model.witnessed),
        possible=_numbers(model.poc, number, model.possible),
    )


def _numbers(
    poc: PocSet, number: dict[bytes, int], chosen: list[Vertex] | None
) -> tuple[int, ...] | None:
    if chosen is None:
        return None
    return tuple(sorted(number[row.tobytes()] for row in corners(poc, chosen)))
