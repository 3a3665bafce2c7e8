"""Finds maps of places that look alike, and the clones to grow of them.

Where the same state has led to different ones, and neither a cover nor a latch tells
them apart, a map of all past readings is looked for: seldom, as it takes a second. It
is tried before it is believed: it must go with what is read until each way from each
clone may have been taken `VISITS` times more. Then its clones are grown, one a tick. If
there are surprises all the same, another map is looked for, which takes its place.
"""

from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.clones import OPEN, VISITS, Map, Walk, find_map, walk_in
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.agent.moves import moves_in
from neurosnap.agent.places_apart import telling
from neurosnap.poc.learning.archive import Arrays, entry, rows_in
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import History

_FIRST: Final = 256  # the tick of the first search; each later one is at twice as many
_LATE: Final = 8192  # ticks that are searched: a second
_ATTEMPTS: Final = 4  # ticks in a row at which a search begins with other chances
_UNEXPLAINED: Final = 4  # surprises that nothing explained, since the last search


class _Sought(msgspec.Struct):
    """What is looked for, tried, and grown."""

    search: int = _FIRST
    """The tick at which a search is due."""
    attempts: int = 0
    """How many are left of the search under way."""
    unexplained: int = 0
    """Surprises since the last search that nothing explained."""
    sensors: list[int] = []
    """The world's own whose readings tell the places of the map apart."""
    looks: list[list[bool]] = []
    """Of the map that is tried or grown; none: there is none. See `Map`."""
    leads: list[list[int]] = []
    """See `Map`."""
    believed: int = 0
    """The tick from which on it is believed, if it was right until then."""
    first: int = -1
    """The number of its first clone; -1: none is grown yet."""

    @property
    def map(self) -> Map:
        return Map(np.array(self.looks, np.bool_), np.array(self.leads, np.int64))

    def clone(self, place: int) -> Context:
        """Return what makes one of its clones be on."""
        ways = [
            (action, self.first + before)
            for action, leads in enumerate(self.leads)
            for before, after in enumerate(leads)
            if after == place
        ]
        look = zip(self.sensors, self.looks[place], strict=True)
        return Context(
            -1,
            tuple(2 * sensor + (not on) for sensor, on in look),
            ways=tuple(number for way in ways for number in way),
            among=(self.first, len(self.looks)),
        )


class MapGrower:
    """Finds the next clone to grow.

    Args:
        body: What is sensed and done, with room for what is grown.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self._sought = _Sought()

    def fit(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        self._body = body

    def find(
        self, history: History, unexplained: int, coins: NDArray[np.bool_]
    ) -> Search[Context | None]:
        """Find a clone to grow at this tick. Few ticks take long; see `find_map`.

        Args:
            history: Of the sensors, with the readings of this tick.
            unexplained: How many surprises of this tick nothing explains.
            coins: ``(n,)``: which of the world's own sensors may tell no place from
                another; unless they are `telling`, they make no look.
        """
        sought = self._sought
        sought.unexplained += unexplained
        if sought.first >= 0:
            if (place := self._body.size - sought.first) < len(sought.looks):
                return sought.clone(place)
            self._drop()
        elif sought.looks and history.tick >= sought.believed:
            walk = yield from self._walk(history, sought.sensors)
            free = self._body.room - len(self._body.grown)
            if not sought.map.follow(walk)[1] and len(sought.looks) <= free:
                sought.first = self._body.size
                return sought.clone(0)
            self._drop()
        elif not sought.looks:
            yield from self._look_for(history, coins)
        return None

    def _drop(self) -> None:
        """Give up the map that was tried, or that was grown: then the body has it."""
        self._sought.looks, self._sought.leads, self._sought.first = [], [], -1

    def _look_for(self, history: History, coins: NDArray[np.bool_]) -> Search[None]:
        """Go on with a search, or begin one if it is due."""
        sought = self._sought
        if history.tick >= sought.search:
            due = sought.unexplained >= _UNEXPLAINED
            sought.search, sought.unexplained = 2 * history.tick, 0
            if due and not (yield from self._is_explained(history)):
                sought.attempts = _ATTEMPTS
        if not sought.attempts:
            return
        sought.attempts -= 1
        sensors = np.flatnonzero(self._body.position[: 2 * len(coins) : 2])
        walk = yield from self._walk(history, sensors.tolist())
        actions = len(self._body.actions)
        kept = ~coins[sensors] | telling(moves_in(walk), actions)
        late = slice(-_LATE, None)
        walk = Walk(walk.on[late, kept], walk.off[late, kept], walk.actions[late])
        found, left_open = find_map(walk, actions, sought.attempts)
        if left_open > OPEN:
            sought.attempts = 0
        if found is not None and found.is_whole and not found.follow(walk)[1]:
            sought.sensors = sensors[kept].tolist()
            sought.looks, sought.leads = found.looks.tolist(), found.leads.tolist()
            sought.believed = history.tick + VISITS * found.leads.size
            sought.attempts = 0

    def _is_explained(self, history: History) -> Search[bool]:
        """Tell whether the last map goes with all that was read."""
        if not self._body.maps:
            return False
        *_, last = self._body.maps
        walk = yield from self._walk(history, last.sensors.tolist())
        return not last.map.follow(walk)[1]

    def _walk(self, history: History, sensors: list[int]) -> Search[Walk]:
        """Ask what some of the world's own sensors read, and what was done."""
        first = len(self._body.own)
        taken = [2 * (first + action) for action in range(len(self._body.actions))]
        asked = (*taken, *(a for k in sensors for a in (2 * k, 2 * k + 1)))
        read = (yield Question(readings=asked)).readings
        return walk_in(read, sensors, taken, history.tick)

    def readings(
        self, clone: Context, history: History
    ) -> Search[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
        """Return at which ticks a clone would have been on, and off: ``(m,)`` each."""
        walk = yield from self._walk(history, self._sought.sensors)
        possible, _ = self._sought.map.follow(walk)
        mine = possible[:, self._body.size - clone.among[0]]
        return mine & (possible.sum(axis=1) == 1), ~mine

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        text = msgspec.json.encode(self._sought)
        return {"map": np.frombuffer(text, np.uint8)}

    def restore(self, arrays: Arrays) -> None:
        """Restore the whole state from arrays; ValueError if they make no sense."""
        text = entry(arrays, "map", (rows_in(arrays, "map"),), np.uint8)
        try:
            sought = msgspec.json.decode(text.tobytes(), type=_Sought)
        except msgspec.DecodeError as error:
            raise ValueError(f"map: {error}") from error
        clones = len(sought.looks)
        leads = [after for row in sought.leads for after in row]
        if (
            any(len(look) != len(sought.sensors) for look in sought.looks)
            or any(len(row) != clones for row in sought.leads)
            or not all(-1 <= after < clones for after in leads)
            or not all(0 <= k < len(self._body.own) for k in sought.sensors)
            or len(sought.leads) != (len(self._body.actions) if clones else 0)
            or not -1 <= sought.first <= (self._body.size if clones else -1)
        ):
            raise ValueError(f"map: must be of what there is, got {sought}")
        self._sought = sought
