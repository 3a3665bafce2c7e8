"""What is drawn: a poc set, its dual as far as it can be listed, and what is marked.

A model comes from the name of one of the paper's examples, from a recording or from an
expression; everything the picture and the printed numbers say is worked out here.
"""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.poc.cubing import Cubing
from neurosnap.poc.examples import EXAMPLES, Example
from neurosnap.poc.pocset import PocSet
from neurosnap.poc.realization import Realization, corners
from neurosnap.poc.topology import CellComplex
from neurosnap.record.history import snapshot_at
from neurosnap.record.reader import Recording
from neurosnap.sensorium import unpack

LIMIT = 256
"""The most vertices that are drawn without being asked to draw more."""

MOST = 400
"""The most elements a Hasse diagram is drawn of."""

Vertex = NDArray[np.bool_]


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


@dataclass(frozen=True, slots=True)
class Mark:
    """A vertex the picture points at.

    Attributes:
        kind: ``"corner"``, ``"median"``, ``"puncture"``, ``"split"`` or ``"image"``.
        vertex: ``(2N,)`` bool.
        sign: A letter or a number to stand on it.
    """

    kind: str
    vertex: Vertex
    sign: str = ""


@dataclass(frozen=True)
class Model:
    """A poc set with what its picture shows besides.

    Attributes:
        name: What it was asked for by.
        title: What it is, in a line.
        poc: The poc set.
        fields: A realisation, or what was observed.
        witness: What shows a vertex: ``"a point"``, ``"an observation"``.
        marks: The vertices it points at.
        state: ``(2N,)`` bool: the current state.
        parts: Sensors to whose own duals projections are drawn, with captions.
        target: What a morphism from it leads to, drawn beside it.
        joined: The pairs of marks that are ends of an edge of the target's dual.
        limit: The most vertices that are listed.
        lenient: Whether a dual too large to list is left out instead of refused.
    """

    name: str
    title: str
    poc: PocSet
    fields: Realization | None = None
    witness: str = "a point"
    marks: tuple[Mark, ...] = ()
    state: NDArray[np.bool_] | None = None
    parts: tuple[tuple[str, tuple[str, ...]], ...] = ()
    target: "Model | None" = None
    joined: tuple[tuple[int, int], ...] = ()
    limit: int = LIMIT
    lenient: bool = False
    _: None = field(default=None, repr=False)

    @cached_property
    def cubing(self) -> Cubing:
        """The dual."""
        return Cubing(self.poc)

    @cached_property
    def _listing(self) -> tuple[list[Vertex] | None, str | None]:
        try:
            return list(self.cubing.vertices(self.limit)), None
        except InvalidValueError as error:
            if not self.lenient:
                rule = f"must have at most {self.limit} vertices to be drawn; see --limit"
                raise InvalidValueError("dual", rule, error.value) from error
            return None, f"it has {error.value} vertices, more than {self.limit}"

    @property
    def vertices(self) -> list[Vertex] | None:
        """The vertices of the dual; None if they are too many.

        Raises:
            InvalidValueError: They are too many, and it is not lenient.
        """
        return self._listing[0]

    @property
    def unlisted(self) -> str | None:
        """Why there is no list of vertices."""
        return self._listing[1]

    @cached_property
    def witnessed(self) -> list[Vertex] | None:
        """The vertices that are shown."""
        return None if self.fields is None else self.fields.vertices(self.poc)

    def numbers(self) -> Numbers:
        """Return what it measures."""
        whole = punctured = None
        if self.vertices is not None:
            whole = CellComplex.cubical(corners(self.poc, self.vertices))
            if self.witnessed is not None:
                punctured = CellComplex.cubical(corners(self.poc, self.witnessed))
        faces = None if whole is None else whole.face_vector()
        possible = None
        if faces is not None and self.state is not None:
            possible = self.cubing.convex_set(self.state).count()
        return Numbers(
            model=self.name,
            title=self.title,
            poc=str(self.poc),
            sensors=len(self.poc),
            height=self.poc.height(),
            width=self.poc.width(),
            vertices=None if faces is None else faces[0],
            edges=None if faces is None else sum(faces[1:2]),
            faces=faces,
            dimension=None if faces is None else len(faces) - 1,
            betti=None if whole is None else whole.betti_numbers(),
            witnessed=None if self.witnessed is None else len(self.witnessed),
            punctured_faces=None if punctured is None else punctured.face_vector(),
            punctured_betti=None if punctured is None else punctured.betti_numbers(),
            possible=possible,
            unlisted=self.unlisted,
        )


def names() -> dict[str, str]:
    """Return the named models and what they are."""
    return {name: make().title for name, make in _NAMED.items()}


def find(text: str, tick: int | None = None, limit: int = LIMIT) -> Model:
    """Return the model that is asked for.

    Args:
        text: The name of one, a recording's path, or an expression as
            `PocSet.parse` reads it.
        tick: Of a recording: as it was after this tick.
        limit: The most vertices that are listed.

    Raises:
        InvalidValueError: There is no such model, the expression is wrong, or there
            is too much to draw.
        RecordingError: The recording is damaged or somebody else's.
    """
    if limit < 1:
        raise InvalidValueError("limit", "must be at least 1", limit)
    if text in _NAMED:
        found = _of_example(text, _NAMED[text]())
    elif text.endswith(".mcap") or Path(text).is_file():
        found = of_recording(Path(text), tick)
        tick = None
    elif any(sign in text for sign in ",:<=≤"):
        found = Model("model", f"The poc set on {text.strip()}", PocSet.parse(text))
    else:
        raise InvalidValueError("model", _unknown(text), text)
    if tick is not None:
        raise InvalidValueError("tick", "must be of a recording (.mcap)", text)
    elements = len(np.unique(found.poc.graph.representative))
    if elements > MOST:
        rule = f"must have at most {MOST} elements to be drawn"
        raise InvalidValueError("poc set", rule, elements)
    if not elements:
        raise InvalidValueError("poc set", "must have a sensor to be drawn", text)
    return replace(found, limit=limit)


def of_recording(path: Path, tick: int | None = None) -> Model:
    """Return what a recorded run had learned after a tick, and its state there.

    What was observed by then takes the place of a realisation.
    """
    recording = Recording.open(path)
    tick, snapshot = snapshot_at(recording, tick)
    poc = PocSet.from_graph(snapshot.poc_graph(), snapshot.sensorium)
    count, state, seen = len(poc), None, []
    for recorded in recording.messages(("observe", "state")):
        match recorded.message:
            case wire.Observation(tick=now, bits=bits) if now <= tick:
                seen.append(unpack(bits, count))
            case wire.State(tick=now, literals=literals) if now == tick:
                state = unpack(literals, 2 * count)
            case _:
                pass
    fields = None
    if seen:
        fields = Realization(np.unique(np.array(seen), axis=0).T, poc.sensorium)
    return Model(
        name=path.stem,
        title=f"{path.name}: what was learned by tick {tick}",
        poc=poc,
        fields=fields,
        witness="an observation",
        state=state,
        lenient=True,
    )


def _unknown(text: str) -> str:
    """Return the rule that no model's name breaks."""
    close = difflib.get_close_matches(text, _NAMED, n=2, cutoff=0.5)
    hint = f" (did you mean {' or '.join(close)}?)" if close else ""
    return (
        'must be a name of --list, a recording or an expression like "a, b : a < b*"'
        + hint
    )


def _of_example(name: str, example: Example) -> Model:
    """Return a named example with what its figure shows."""
    model = Model(name, example.title, example.poc, example.fields)
    marks = example.marks()
    if len(marks) == 4:
        signs = zip(("u", "v", "w", "m"), marks, strict=True)
        kinds = {"m": "median"}
        found = [Mark(kinds.get(sign, "corner"), u, sign) for sign, u in signs]
        return replace(model, marks=tuple(found))
    if marks and example.fields is not None:
        shown = bool(example.fields.witnesses(marks[0]).any())
        return replace(model, marks=(Mark("split" if shown else "puncture", marks[0]),))
    if example.morphism is not None:
        return _with_target(model, example)
    actions = tuple(a for a in example.poc.sensorium if a in ("fwd", "back", "wait"))
    if actions:
        plain = {*actions, *(a for a in example.poc.sensorium if a.startswith("("))}
        places = tuple(a for a in example.poc.sensorium if a not in plain)
        return replace(model, parts=(("position", places), ("action", actions)))
    return model


def _with_target(model: Model, example: Example) -> Model:
    """Return a model whose dual shows where the dual of a morphism leads."""
    morphism = example.morphism
    if morphism is None:
        return model
    there = list(Cubing(morphism.target).vertices())
    signs = [str(k + 1) for k in range(len(there))]
    hops = [(int((u != v).sum()), i, j) for i, u in enumerate(there)
            for j, v in enumerate(there[:i])]
    ends = [(j, i) for many, i, j in hops if many == 2]
    target = Model(
        name=f"{model.name}'s target",
        title="Where the morphism leads",
        poc=morphism.target,
        marks=tuple(Mark("image", u, s) for u, s in zip(there, signs, strict=True)),
        joined=tuple(ends),
    )
    images = [morphism.dual(u) for u in there]
    marks = tuple(Mark("image", u, s) for u, s in zip(images, signs, strict=True))
    return replace(model, marks=marks, joined=tuple(ends), target=target)


def _spelled(makers: Iterable[tuple[str, object]]) -> dict[str, str]:
    return {short: getattr(make, "__name__", short) for short, make in makers}


_NAMED = {
    **{make.__name__.replace("_", "-"): make for make in EXAMPLES.values()},
}
