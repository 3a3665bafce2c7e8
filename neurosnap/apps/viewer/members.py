"""The parts of a swarm, and how many messages each has sent.

A part's messages have running numbers. So its last one says how many there were, and
only the end of a recording has to be read: every cell reports on every tick.
"""

from collections.abc import Collection
from pathlib import Path

from neurosnap import wire
from neurosnap.apps.viewer.api import Cells, Member
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import RecordingError
from neurosnap.fabric.location import Place
from neurosnap.protocol.partition import shares
from neurosnap.runtime.registry import Part, parts, recorded_in

_LATEST = 16
"""Chunks at the end of a recording that are read, at most."""
_REPORTING = ("settle", "tally", "observe", "state", "decide", "leave")
"""What each part sends on every tick, or at its end."""


def members(run_view: RunView) -> Cells:
    """Return the parts of a recorded swarm, or of one that is being recorded.

    Raises:
        RecordingError: The recording's totals, or the places it notes, are not what a
            writer writes.
    """
    hosting = _hosting(run_view)
    sent = _sent(run_view, hosting)
    there = {part.who: part for part in _running(run_view.path)}
    places = run_view.recording.places
    services = [who for who in ("coordinator", "world") if who in sent]
    return Cells(
        cells=[
            Member(
                who=who,
                sensors=list(hosting.get(who, ())),
                messages=sent.get(who, 0),
                restarts=len(run_view.resumed),
                host=_host(there.get(who), places.get(who)),
            )
            for who in (*services, *hosting)
        ],
        read_to=run_view.last,
    )


def _hosting(run_view: RunView) -> dict[str, range]:
    """Return of each worker or cell, in order, which sensors it has."""
    options = run_view.options
    count = len(options.sensors)
    each = shares(count, options.sharing or count) if count else []
    return dict(zip(options.host_names(), each, strict=True))


def _sent(run_view: RunView, hosting: Collection[str]) -> dict[str, int]:
    """Return how many messages each part has sent, as far as those that host go."""
    noted = run_view.recording.noted().expected
    if noted:
        return noted
    sent: dict[str, int] = {}
    missing = set(hosting)
    for _, chunk in run_view.tick_index.readable_back(_LATEST):
        for topic in _REPORTING:
            try:
                messages = chunk.all(topic, wire.TOPICS[topic])
            except RecordingError:
                continue
            for message, number in zip(messages, chunk.sequences(topic), strict=True):
                sent[message.sender] = max(sent.get(message.sender, 0), number + 1)
        missing -= sent.keys()
        if not missing:
            break
    return sent


def _running(log: Path) -> list[Part]:
    """Return the processes of this machine that are recorded there now."""
    return [part for note in recorded_in(log) for part in parts(note)]


def _host(part: Part | None, place: Place | None) -> str | None:
    if part is not None:
        return f"this machine, process {part.pid}"
    return None if place is None else f"host {place.host}, process {place.pid}"
