"""The tables a source can be described by, told apart by their `kind`.

Another kind is another struct in `SourceTable`: its `kind` is its tag, and `opening`
says how it is opened.
"""

from pathlib import Path
from typing import Annotated, TypeAlias

import msgspec

from neurosnap.source import Argument

Text: TypeAlias = Annotated[str, msgspec.Meta(min_length=1)]
Opening: TypeAlias = tuple[str, dict[str, Argument]]
"""The name and the arguments that `neurosnap.source.open_source` takes."""


class WorldTable(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="world",
):
    """A Gymnasium environment."""

    id: Text
    """Its id, `neurosnap/Path-v0`; `module:Id` imports a module first."""
    arguments: dict[str, Argument] = {}
    """What it is made with."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened; a world is the same from any folder."""
        return self.id, dict(self.arguments)


class CsvTable(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="csv",
):
    """A CSV file of readings."""

    # Whatever has this ending is opened as a file, whether it is there or not.
    path: Annotated[str, msgspec.Meta(pattern=r"\.[cC][sS][vV]$")]
    """Where it is; its name ends with `.csv`."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened, by its path from `folder`."""
        return str(folder / self.path), {}


SourceTable: TypeAlias = WorldTable | CsvTable
"""What may stand under `[source]`."""
