"""A run as a table: one row per tick, one column per sensor.

What was not recorded, and a reading that was not known, is None. The state is one text:
a letter a sensor, in their order, T where the sensor itself is in the state, F where
its complement is, ? where neither; digits would be read back as a number.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from neurosnap.agent.body import Body
from neurosnap.errors import RecordingError
from neurosnap.recording.read.ticks import Tick
from neurosnap.sensorium import unpack, unpack_readings

Kind: TypeAlias = Literal["time", "number", "bit", "text"]
Cell: TypeAlias = int | bool | str | None
"""Times are nanoseconds since the epoch."""

_LATEST = 2**63
"""Times before this can be written as dates: up to the year 2262."""


class Column(NamedTuple):
    """What a column is called, and what it holds."""

    name: str
    kind: Kind


class Table:
    """Makes rows of ticks.

    Args:
        body: What the run senses and does, with all that it grows; a sensor is not
            known before it is.
    """

    def __init__(self, body: Body) -> None:
        self._count, self._size = len(body.sensors), body.size
        self._names = body.sensors[: body.size]
        self._grows = body.room > 0
        self._decisions = body.actions
        time = Column("time", "time")
        before = (Column("tick", "number"), Column("begins", "bit"))
        after = (
            Column("state", "text"),
            *(Column(name, "number") for name in ("depth", "height", "edges")),
            Column("pulses", "number"),
            Column("incoherent", "bit"),
            Column("decision", "text"),
            Column("why", "text"),
            *(Column(name, "text") for name in ("grew", "retired") if self._grows),
        )
        taken = [column.name for column in (time, *before, *after)]
        names = _apart(self._names, taken)
        sensed = (Column(name, "bit") for name in names)
        self.columns: tuple[Column, ...] = (time, *before, *sensed, *after)

    def row(self, tick: Tick) -> list[Cell]:
        """Return the cells of a tick, one a column. O(N) time.

        Raises:
            RecordingError: It is not of such sensors and actions.
        """
        bits = self._bits(tick)
        begins = None if tick.observation is None else tick.observation.begins
        return [
            self._time(tick),
            tick.number,
            begins,
            *bits,
            *self._outcome(tick),
            *self._decided(tick),
            *self._changed(tick),
        ]

    def _time(self, tick: Tick) -> int | None:
        if tick.observation is None:
            return None
        if tick.sent >= _LATEST:
            raise _wrong(tick, "time: must be before the year 2262", tick.sent)
        return tick.sent

    def _bits(self, tick: Tick) -> list[bool | None]:
        if tick.observation is None:
            return [None] * self._size
        try:
            bits, known = unpack_readings(
                tick.observation.bits, tick.observation.known, self._count
            )
        except ValueError as error:
            raise _wrong(tick, f"must be of {self._count} sensors", error) from error
        cells: list[bool | None] = bits[: self._size].tolist()
        if known is None:
            return cells
        sure = known[: self._size]
        return [bit if told else None for bit, told in zip(cells, sure, strict=True)]

    def _outcome(self, tick: Tick) -> list[Cell]:
        state = tick.state
        if state is None:
            return [None] * 6
        try:
            literals = unpack(state.literals, 2 * self._count)[: 2 * self._size]
        except ValueError as error:
            raise _wrong(tick, f"must be of {self._count} sensors", error) from error
        signs = np.where(literals[::2], "T", np.where(literals[1::2], "F", "?"))
        return [
            "".join(signs.tolist()),
            state.depth,
            state.height,
            state.edges,
            state.pulses,
            state.incoherent,
        ]

    def _decided(self, tick: Tick) -> list[Cell]:
        if tick.decision is None:
            return [None, None]
        action = tick.decision.action
        if action >= len(self._decisions):
            rule = f"decision: must be one of {len(self._decisions)}"
            raise _wrong(tick, rule, action)
        return [self._decisions[action] if action >= 0 else None, tick.decision.why]

    def _changed(self, tick: Tick) -> list[Cell]:
        """Return which sensor a tick's decision grew, and which it retired."""
        if not self._grows:
            return []
        decision = tick.decision
        named = (-1, -1) if decision is None else (decision.born, decision.retires)
        return [
            self._names[sensor] if 0 <= sensor < self._size else None
            for sensor in named
        ]


def _apart(names: Sequence[str], taken: Sequence[str]) -> list[str]:
    """Return names that no other column has: with underscores where one would."""
    every = {*names, *taken}
    apart: list[str] = []
    for name in names:
        found = name
        if name in taken:
            while found in every:
                found += "_"
            every.add(found)
        apart.append(found)
    return apart


def _wrong(tick: Tick, rule: str, got: object) -> RecordingError:
    return RecordingError(f"tick {tick.number}: {rule}, got {got}")
