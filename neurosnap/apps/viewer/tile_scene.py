"""A world of tiles as a tick's readings have it: who is where, and in what state."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.tile_map import TileMap
from neurosnap.apps.viewer.api import Stage, Thing
from neurosnap.apps.viewer.qualities import NONE, Qualities

_SURROUND = "wall"


class TileScene:
    """What can be drawn of a world of tiles.

    Args:
        tile_map: What it looks like.
        names: The world's sensors, in order.
        actions: What can be done in it.
    """

    def __init__(
        self, tile_map: TileMap, names: Sequence[str], actions: Sequence[str]
    ) -> None:
        self._rows = len(tile_map.rows)
        self._columns = len(tile_map.rows[0])
        self._tiles = [tile for row in tile_map.rows for tile in row]
        self._qualities = Qualities(names)
        self._drops = "drop" in actions
        framed = all(row[0] == _SURROUND for row in tile_map.rows)
        self._frame = 1 if framed else 0  # nobody is on the tiles around
        columns = range(self._columns)
        self.stage = Stage(
            kind="map",
            places=len(self._tiles),
            coordinates=[
                (x, self._rows - 1 - y) for y in range(self._rows) for x in columns
            ],
            width=self._columns,
            height=self._rows,
            target=None,
            # What is carried, opened or shut is no tile: it is drawn as it is.
            tiles=["floor" if tile == "key" else tile for tile in self._tiles],
            walls=[(self._number(*a), self._number(*b)) for a, b in tile_map.walls],
        )

    def place(self, observed: NDArray[np.bool_]) -> int | None:
        """Return the number of the agent's tile; None: that is not known.

        Args:
            observed: ``(2N,)``, the literals of the sensors whose reading is known.
        """
        number, frame = self._qualities.number, self._frame
        row = number("row", observed, self._rows - 1 - frame)
        column = number("column", observed, self._columns - 1 - frame)
        if row is None or column is None:
            return None
        inside = 0 <= row < self._rows and 0 <= column < self._columns
        return self._number(row, column) if inside else None

    def heading(self, observed: NDArray[np.bool_]) -> str:
        """Return which way the agent looks; empty: none is known."""
        return self._qualities.values(observed).get("facing", NONE)

    def things(self, observed: NDArray[np.bool_]) -> list[Thing]:
        """Return what else there is, as far as that is known."""
        return list(self._things(self._qualities.values(observed)))

    def _things(self, values: Mapping[str, str]) -> Iterator[Thing]:
        match values.get("passenger"):
            case "taxi":
                yield Thing("passenger", None, words="passenger in the taxi")
            case str() as stop if stop in self._tiles:
                yield self._thing("passenger", stop, f"passenger at {stop}")
        stop = values.get("destination", NONE)
        if stop in self._tiles:
            yield self._thing("destination", stop, f"destination {stop}")
        if "door" in self._tiles and "door" in values:
            state = values["door"] or "closed"
            yield self._thing("door", "door", f"door {state}", state)
        match values.get("carries"):
            case "key":
                yield Thing("key", None, words="carries the key")
            # It may have been put down anywhere.
            case "" if "key" in self._tiles and not self._drops:
                yield self._thing("key", "key", "key not taken")

    def _thing(self, what: str, tile: str, words: str, state: str = "") -> Thing:
        return Thing(what, self._tiles.index(tile), words=words, state=state)

    def _number(self, row: int, column: int) -> int:
        return row * self._columns + column
