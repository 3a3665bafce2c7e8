"""A model to draw: a poc set, its dual, and what was seen of it.

It is found by the name of one of the paper's model spaces, in a recording, or from an
expression of generators and relations.
"""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.homology import CellComplex
from neurosnap.poc.dual.realization import Realization, corners
from neurosnap.poc.order.pocset import PocSet
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.births import births_of
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.sensorium import unpack, unpack_readings
from tools.paper.spaces import EXAMPLES

LIMIT = 256
"""The most vertices that are listed without being asked to list more."""

_KINDS = ("vertices", "edges", "squares", "cubes")

Vertex = NDArray[np.bool_]


@dataclass(frozen=True)
class Model:
    """A poc set with what its picture shows besides.

    Attributes:
        title: What it is, in a line.
        poc: The poc set.
        fields: A realisation, or what was observed.
        marked: Vertices the picture points at.
        state: ``(2N,)`` bool: the current state.
        limit: The most vertices that are listed.
    """

    title: str
    poc: PocSet
    fields: Realization | None = None
    marked: tuple[Vertex, ...] = ()
    state: Vertex | None = None
    limit: int = LIMIT

    @cached_property
    def vertices(self) -> list[Vertex] | None:
        """The vertices of the dual; None if they are too many."""
        try:
            return list(Cubing(self.poc).vertices(self.limit))
        except InvalidValueError:
            return None

    @cached_property
    def witnessed(self) -> list[Vertex] | None:
        """The vertices that a point, or an observation, shows."""
        return None if self.fields is None else self.fields.vertices(self.poc)

    def measures(self) -> list[str]:
        """Return what it measures, in a few lines."""
        order = f"height {self.poc.height()} · width {self.poc.width()}"
        if self.vertices is None:
            return [f"dual: more than {self.limit} vertices · {order}"]
        dual = CellComplex.cubical(corners(self.poc, self.vertices))
        lines = [f"dual: {_faces(dual)} · {order} · Betti {_betti(dual)}"]
        if self.witnessed is not None:
            punctured = CellComplex.cubical(corners(self.poc, self.witnessed))
            lines.append(f"punctured: {_faces(punctured)} · Betti {_betti(punctured)}")
        return lines


def _faces(cells: CellComplex) -> str:
    """Return a face vector in words."""
    named = enumerate(cells.face_vector())
    return " · ".join(
        f"{count} {_KINDS[d] if d < len(_KINDS) else f'{d}-cubes'}"
        for d, count in named
    )


def _betti(cells: CellComplex) -> str:
    return ", ".join(map(str, cells.betti_numbers())) or "none"


def find(
    text: str, tick: int | None = None, limit: int = LIMIT, only: Sequence[str] = ()
) -> Model:
    """Return the model that is asked for.

    Args:
        text: The name of one, a recording's path, or an expression as
            `PocSet.parse` reads it.
        tick: Of a recording: as it was after this tick.
        limit: The most vertices that are listed.
        only: The sensors to keep, with the order among them; none: all.

    Raises:
        InvalidValueError: There is no such model, or the expression is wrong.
        UnknownSensorError: One of `only` is not among the sensors.
        RecordingError: The recording is damaged or not a run's.
    """
    if text in EXAMPLES:
        example = EXAMPLES[text]()
        found = Model(
            example.title, example.poc, example.fields, tuple(example.marks())
        )
    elif text.endswith(".mcap"):
        found = of_recording(Path(text), tick)
    elif any(sign in text for sign in ",:<=≤"):
        found = Model(f"The poc set on {text.strip()}", PocSet.parse(text))
    else:
        close = difflib.get_close_matches(text, EXAMPLES, n=2, cutoff=0.5)
        hint = f" (did you mean {' or '.join(close)}?)" if close else ""
        rule = f"must be of {', '.join(EXAMPLES)}, a recording or an expression{hint}"
        raise InvalidValueError("model", rule, text)
    return replace(_among(found, only) if only else found, limit=limit)


def of_recording(path: Path, tick: int | None = None) -> Model:
    """Return what a recorded run had learned after a tick, and its state there.

    What was observed by then takes the place of a realisation, where every reading was
    known. A sensor that was not grown yet, or has retired, is left out.
    """
    recording = Recording.open(path)
    tick, snapshot = snapshot_at(recording, tick)
    poc = PocSet.from_graph(snapshot.poc_graph(), snapshot.sensorium)
    count, state, seen = len(poc), None, []
    births = births_of(recording)
    read = births.read_at(tick)
    for recorded in recording.messages(("observation", "state")):
        match recorded.message:
            case wire.Observation() as observation if observation.tick <= tick:
                bits, known = unpack_readings(
                    observation.bits, observation.known, count
                )
                if known is None or known[read].all():
                    seen.append(bits[read])
            case wire.State(tick=now, literals=literals) if now == tick:
                pairs = unpack(literals, 2 * count).reshape(count, 2)
                state = pairs[read].ravel()
            case _:
                pass
    if len(read) < count:
        poc = poc.restricted(births.names[sensor] for sensor in read)
    fields = None
    if seen:
        fields = Realization(np.unique(np.array(seen), axis=0).T, poc.sensorium)
    title = f"{path.name}: what was learned by tick {tick}"
    return Model(title, poc, fields, state=state)


def _among(model: Model, names: Sequence[str]) -> Model:
    """Return a model of some of its sensors; what is marked in it is left out."""
    poc = model.poc.restricted(names)
    every = list(model.poc.sensorium)
    rows = [every.index(name) for name in poc.sensorium]
    fields, state = model.fields, model.state
    if fields is not None:
        fields = Realization(fields.fields[rows], poc.sensorium)
    if state is not None:
        state = state.reshape(-1, 2)[rows].ravel()
    title = f"{model.title} ({len(rows)} of {len(every)} sensors)"
    return Model(title, poc, fields, state=state)
