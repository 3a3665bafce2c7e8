"""The recordings of one server, in a list to choose from."""

from collections.abc import Sequence

import msgspec

from neurosnap.apps.viewer.names_apart import told_apart
from neurosnap.apps.viewer.session import ViewSession


class Listed(msgspec.Struct, frozen=True, kw_only=True):
    """One recording; its place in the list is its number."""

    name: str
    """As much of its path as tells it from the others."""
    swarm: str
    ticks: int
    live: bool


class Runs(msgspec.Struct, frozen=True):
    """All there are."""

    runs: list[Listed]


def listed(sessions: Sequence[ViewSession]) -> Runs:
    """Return the recordings by number."""
    names = told_apart([session.run_view.path for session in sessions])
    return Runs(
        [
            Listed(
                name=name,
                swarm=session.run_view.recording.swarm,
                ticks=session.run_view.last,
                live=session.live,
            )
            for name, session in zip(names, sessions, strict=True)
        ]
    )
