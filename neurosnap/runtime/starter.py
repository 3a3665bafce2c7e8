"""The protocol for starting the parts of a swarm.

A supervisor decides when a part is started, asked to end or killed, and which part is
to blame for a failure. A starter only does it, and reports what happens to the parts.
"""

import asyncio
from collections.abc import Collection, Sequence
from typing import Protocol

from neurosnap.runtime.parts.job import Job, PartConnection, Report


class Handle(Protocol):
    """A part that was started; stopping one that has ended does nothing."""

    def ask(self) -> None:
        """Ask it to end in order."""

    def kill(self) -> None:
        """End it at once."""


class Listener(Protocol):
    """What a starter reports to; always on the event loop."""

    failed: asyncio.Event
    """Set once the run cannot go on: no other part has to be started."""

    def began(self, who: str, handle: Handle) -> None:
        """Note that a part was started."""

    def receive(self, report: Report) -> None:
        """Receive a report of a part, which may come before it has begun."""

    def ended(self, who: str, how: str, *, in_order: bool) -> None:
        """Note that a part has ended, after all of its reports.

        Args:
            who: Its name.
            how: As in "ended with ...".
            in_order: It ended by itself, or as it was asked to.
        """


class Starter(Protocol):
    """Starts the parts of one swarm."""

    has_hub: bool
    """The parts reach each other through a hub, which is one of them."""

    async def open(self, listener: Listener) -> None:
        """Get ready. If that fails, nothing is left to be closed."""

    async def make_room(self, parts: Collection[str], stop: asyncio.Event) -> None:
        """See to it that these parts fit, before the first of them is started.

        Raises:
            NeurosnapError: There is no room; the text says what is missing.
            NothingBegunError: `stop` was set before there was any.
        """

    async def start(self, jobs: Sequence[tuple[Job, PartConnection]]) -> None:
        """Start a part for each job. Of several at once, reports must be short."""

    async def close(self) -> None:
        """End at once what is left, and what is being started."""
