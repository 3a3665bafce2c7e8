"""What a world of tiles looks like: the part of a drawing that stays as it is.

An environment, or a wrapper around it, that has one as its attribute `tile_map` can be
drawn from what its sensors read, if they tell row and column (``row<3``, ``column<3``).
"""

from dataclasses import dataclass
from typing import TypeAlias

Tile: TypeAlias = tuple[int, int]
"""Row and column, counted from 0 at the top and at the left."""


@dataclass(frozen=True)
class TileMap:
    """Tiles in rows, and the walls between them."""

    rows: tuple[tuple[str, ...], ...]
    """What each tile is, such as ``hole``; all rows are of one length."""
    walls: tuple[tuple[Tile, Tile], ...] = ()
    """Pairs of neighbours that nobody gets from one to the other of."""
