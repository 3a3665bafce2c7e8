"""The model to draw: a poc set, its dual as far as it is listed, marked vertices.

Everything that a picture and the printed numbers say is worked out here.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.realization import Realization
from neurosnap.poc.order.pocset import PocSet
from neurosnap.recording.read.recording import Recording

LIMIT = 256
"""The most vertices that are drawn without being asked to draw more."""

Vertex = NDArray[np.bool_]


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
        recording: What it was learned in.
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
    recording: Recording | None = None

    @property
    def level(self) -> str | None:
        """The sensor whose edges lie level."""
        return self.parts[0][1][0] if self.parts else None

    @property
    def elements(self) -> int:
        """How many literals differ: what a Hasse diagram has a box for."""
        return len(np.unique(self.poc.graph.representative))

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
                rule = (
                    f"must have at most {self.limit} vertices to be drawn; see --limit"
                )
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

    @cached_property
    def possible(self) -> list[Vertex] | None:
        """The vertices that the current state leaves possible, ``h(S)``."""
        if self.state is None or self.vertices is None:
            return None
        return list(self.cubing.convex_set(self.state))
