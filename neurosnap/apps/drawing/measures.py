"""Measures of a model: for the picture's title, the terminal and ``--json``."""

import msgspec

from neurosnap.apps.drawing.model import Model
from neurosnap.poc.dual.homology import CellComplex
from neurosnap.poc.dual.realization import corners

_WORD = ("vertex", "edge", "square", "cube")
_WORDS = ("vertices", "edges", "squares", "cubes")


class Numbers(msgspec.Struct, frozen=True):
    """What a model measures; what needs a list of vertices is null without one."""

    model: str
    title: str
    poc: str
    sensors: int
    height: int
    width: int
    vertices: int | None
    edges: int | None
    faces: tuple[int, ...] | None
    """How many cubes of each dimension the dual has, vertices first."""
    dimension: int | None
    betti: tuple[int, ...] | None
    """Of the dual, over GF(2): always 1, 0, 0, …"""
    witnessed: int | None
    """How many vertices a point shows."""
    punctured_faces: tuple[int, ...] | None
    """The cubes all of whose vertices are witnessed."""
    punctured_betti: tuple[int, ...] | None
    possible: int | None
    """How many vertices hold the current state."""
    unlisted: str | None
    """Why the dual is not listed."""


def measure(model: Model) -> Numbers:
    """Return what a model measures.

    Raises:
        InvalidValueError: Its dual is too large to list, and may not be left out.
    """
    whole = punctured = None
    if model.vertices is not None:
        whole = CellComplex.cubical(corners(model.poc, model.vertices))
        if model.witnessed is not None:
            punctured = CellComplex.cubical(corners(model.poc, model.witnessed))
    faces = None if whole is None else whole.face_vector()
    return Numbers(
        model=model.name,
        title=model.title,
        poc=str(model.poc),
        sensors=len(model.poc),
        height=model.poc.height(),
        width=model.poc.width(),
        vertices=None if faces is None else faces[0],
        edges=None if faces is None else sum(faces[1:2]),
        faces=faces,
        dimension=None if faces is None else len(faces) - 1,
        betti=None if whole is None else whole.betti_numbers(),
        witnessed=None if model.witnessed is None else len(model.witnessed),
        punctured_faces=None if punctured is None else punctured.face_vector(),
        punctured_betti=None if punctured is None else punctured.betti_numbers(),
        possible=None if model.possible is None else len(model.possible),
        unlisted=model.unlisted,
    )


def in_words(numbers: Numbers) -> list[str]:
    """Return what a model measures, in a line or two."""
    order = f"height {numbers.height} · width {numbers.width}"
    if numbers.faces is None:
        return [order, f"dual not listed: {numbers.unlisted}"]
    first = f"dual: {_faces(numbers.faces)} · dimension {numbers.dimension} · {order}"
    if numbers.betti is not None:
        first += f" · Betti {_list(numbers.betti)}"
    facts = [first]
    if numbers.punctured_faces is not None and numbers.punctured_betti is not None:
        facts.append(
            f"punctured: {_faces(numbers.punctured_faces)}"
            f" · Betti {_list(numbers.punctured_betti)}"
        )
    return facts


def _faces(faces: tuple[int, ...]) -> str:
    """Return a face vector in words."""
    named = [
        f"{count} {_WORDS[d] if d < len(_WORDS) else f'{d}-cubes'}"
        if count != 1
        else f"1 {_WORD[d] if d < len(_WORD) else f'{d}-cube'}"
        for d, count in enumerate(faces)
    ]
    return " · ".join(named) or "empty"


def _list(values: tuple[int, ...]) -> str:
    return ", ".join(map(str, values)) or "none"
