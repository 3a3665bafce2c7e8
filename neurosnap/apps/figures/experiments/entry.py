"""An entry of the table of results, and its key."""

import json
from typing import Any, Protocol

import msgspec
from numpy.typing import DTypeLike, NDArray


class Entry(Protocol):
    """An entry of the table: as many rows as there are runs."""

    @property
    def name(self) -> str:
        """The readable part of its file's name."""

    @property
    def key(self) -> str:
        """All that its rows depend on, as one line of text."""

    @property
    def runs(self) -> int:
        """How many rows it has."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of a row."""

    @property
    def dtype(self) -> DTypeLike:
        """The type of a row."""

    def row(self, run: int) -> NDArray[Any]:
        """Return a row: a function of the cell and `run`; called by any thread."""


def key_of(cell: msgspec.Struct, kind: str, version: int) -> str:
    """Return the key of a cell all of whose fields count, as JSON.

    Args:
        cell: The cell.
        kind: What its rows are.
        version: Raised whenever the same fields come to give other rows.
    """
    made = {"kind": kind, "version": version} | msgspec.structs.asdict(cell)
    return json.dumps(made, sort_keys=True)
