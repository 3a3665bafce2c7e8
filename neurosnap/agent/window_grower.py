"""Finds windows of the last ticks to grow as sensors, from what relates the readings.

A relation of several premises, ``belt ∧ gate -> counter``, is one sensor that excludes
a literal: ``belt∧gate`` excludes ``counter*``. So is one that holds once a literal was
read for a while. Of ``valve -> flow within 3`` two sensors exclude each other: that
``flow*`` was read for 3 ticks, and that ``valve`` was 3 ticks ago.

What is looked for, and how sure it must be, is as in the table of relations
(`neurosnap.poc.learning.beyond_pairs`); it must not follow from what the run believes.
Searches are far apart, each over all readings that are kept, and each may err in a
smaller share of tables, so that all together err in as many as one would.

References:
    Not the paper's, as in `neurosnap.agent.grower`.
"""

from collections.abc import Mapping

import msgspec
import numpy as np

from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.poc.learning.archive import Arrays, entry, rows_in
from neurosnap.poc.learning.beyond_pairs import Beyond, Limits, beyond_pairs
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.lags import USUAL, longest_lag
from neurosnap.poc.learning.pair_occasions import count_pairs
from neurosnap.poc.learning.pairs import codes_of, leads
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.learning.relation_rule import judge
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import Words, from_words
from neurosnap.sensorium import Sensorium

_FIRST = 64
"""The tick of the first search; later ones are at twice as many each, until the history
is full, and then whenever half of it is new."""
_WORK = 1 << 31
"""Words of 64 ticks that a search looks at: a second or two, while the run waits."""


class WindowGrower:
    """Finds the next window to grow, by what relates the readings.

    Args:
        body: What is sensed, with room for what is grown.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self._wanted: list[Context] = []

    def fit(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        self._body = body

    def find(self, history: History, snapshot: Snapshot) -> Search[Context | None]:
        """Find a window to grow at this tick.

        All readings are asked for if a search is due; that takes as long as a table of
        relations of as many ticks.

        Args:
            history: Of the sensors, with the readings of this tick.
            snapshot: Says what is believed, and would be.
        """
        body = self._body
        search = _search_at(history.tick, history.length)
        if search and len(body.grown) < body.room:
            asked = tuple(range(2 * len(body.own)))
            read = (yield Question(readings=asked)).readings
            columns = _columns(body, read, history)
            self._wanted = self._search(columns, snapshot, search)
        while self._wanted and len(body.grown) < body.room:
            window = self._wanted.pop(0)
            if window not in body.in_use:
                return window
        return None

    def _search(
        self, columns: Columns, snapshot: Snapshot, search: int
    ) -> list[Context]:
        """Return the windows that the readings ask for, what explains most first."""
        graph, own = snapshot.poc_graph(), len(columns.on)
        believed = from_words(graph.closed, len(graph))[: 2 * own, : 2 * own]
        edges = ((a, b) for a, b in np.argwhere(believed).tolist() if a >> 1 != b >> 1)
        given, counts = codes_of(edges, own * (own - 1) // 2), count_pairs(columns)
        # Shares of 1/2, 1/6, 1/12 and so on add up to 1.
        lag, shares = longest_lag(columns, USUAL, _WORK), search * (search + 1)
        limits = Limits(lag=lag, shares=shares, work=_WORK)
        codes = judge(columns, counts).codes
        found, _, _ = beyond_pairs(columns, counts, codes, given, limits)
        found.sort(key=lambda one: -one.explains)
        known = {Context(-1, (a,)): a for a in range(2 * own)}
        for place, window in enumerate(self._body.grown):
            if place not in self._body.retired:
                known[window] = 2 * (self._body.first_grown + place)
                if (of_one_tick := _positive(window)) is not None:
                    opposite = (of_one_tick.literals[0] ^ 1,)
                    known[window._replace(literals=opposite)] = known[window] ^ 1
        wanted = dict[Context, None]()
        for one in found:
            excluding = _windows(one)
            if _would_believe(snapshot, one) and not _follows(*excluding, known, graph):
                wanted |= dict.fromkeys(
                    _positive(each) or each for each in excluding if each not in known
                )
        return list(wanted)

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        text = msgspec.json.encode(self._wanted)
        return {"windows": np.frombuffer(text, np.uint8)}

    def restore(self, arrays: Arrays) -> None:
        """Restore the whole state from arrays; ValueError if they make no sense."""
        text = entry(arrays, "windows", (rows_in(arrays, "windows"),), np.uint8)
        try:
            self._wanted = msgspec.json.decode(text.tobytes(), type=list[Context])
        except msgspec.DecodeError as error:
            raise ValueError(f"windows: {error}") from error
        for window in self._wanted:
            msgspec.structs.replace(self._body, room=1, grown=(window,), retired=())


def _search_at(tick: int, length: int) -> int:
    """Return which search is due at a tick, from 1; 0: none."""
    if tick < _FIRST:
        return 0
    if tick <= length:
        return (tick // _FIRST).bit_length() if tick & (tick - 1) == 0 else 0
    turn, rest = divmod(tick - length, length // 2)
    return 0 if rest else (length // _FIRST).bit_length() + turn


def _columns(body: Body, read: Mapping[int, Words], history: History) -> Columns:
    """Return what was read at the last ticks, which are a multiple of 64."""
    words = len(history.begun)
    first = history.tick // 64 % words if history.tick > history.length else 0
    kept = (first + np.arange(history.ticks // 64)) % words
    on, off = (
        np.stack([read[a][kept] for a in range(k, 2 * len(body.own), 2)])
        for k in (0, 1)
    )
    return Columns(Sensorium(body.own), history.ticks, on, off)


def _windows(one: Beyond) -> tuple[Context, Context]:
    """Return a window, and another or a literal, that exclude each other."""
    if one.lag is None:
        premises = Context(-1, tuple(sorted(one.premises)))
        return premises, Context(-1, (one.conclusion ^ 1,))
    ago = one.lag.ticks if one.lag.first else 0
    throughout = Context(-1, (one.lag.throughout,), since=one.lag.ticks)
    return throughout, Context(-1, (one.lag.end,), since=ago, until=ago)


def _positive(window: Context) -> Context | None:
    """Return the window that reads one sensor at one tick, or reads it off; if it does.

    Both are literals of one sensor.
    """
    if window.since > window.until or len(window.literals) > 1:
        return None
    return window._replace(literals=(window.literals[0] & ~1,))


def _would_believe(snapshot: Snapshot, one: Beyond) -> bool:
    """Return whether a snapshot would believe it, were it a relation of two sensors.

    Else what is grown would retire at once, and be grown again.
    """
    square, literal = one.counts.ticks, one.conclusion ^ 1
    if one.lag is not None:  # counted from the other side
        square, literal = square[[0, 2, 1, 3]], one.lag.end
    square = square[[1, 0, 3, 2]] if literal & 1 else square
    code = snapshot.code_of(square, literal >> 1)
    return leads(code, (literal | 1) + 1, literal ^ 1)


def _follows(
    window: Context, other: Context, known: Mapping[Context, int], graph: PocGraph
) -> bool:
    """Return whether it follows from known windows that two exclude each other.

    It does if a part of each excludes the other, also if both were so later.
    """
    for later in range(other.until + 1):
        moved = other._replace(since=other.since - later, until=other.until - later)
        if moved in known:
            above = graph.up([known[moved]])
            shorter = window._replace(since=window.since - later)
            if any(above[a ^ 1] and shorter.includes(w) for w, a in known.items()):
                return True
    return False
