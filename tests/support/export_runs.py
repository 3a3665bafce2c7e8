"""Recorded runs to export."""

from pathlib import Path

from neurosnap.agent.body import Body
from tests.support.inline_runs import (
    ACTIONS,
    implying_rows,
    record_scripted,
    scripted_options,
)
from tests.support.scripted_sources import Scripted

TICKS = 40
NAMES = ("depth", "front.door", 'a "b" & c')


def rows(unknown: bool) -> list[list[bool | None]]:
    return implying_rows(TICKS, 5, 0.2 if unknown else 0.0)


def recorded(log: Path, *, unknown: bool = True, acts: bool = True) -> Path:
    """Record a run in this process."""
    body = Body.full(NAMES, ACTIONS) if acts else Body(own=NAMES)
    source = Scripted(rows(unknown), ACTIONS if acts else ())
    options = scripted_options(
        TICKS, body=body, keyframe_every=10, watch=True, support=1
    )
    return record_scripted(source, options, log)
