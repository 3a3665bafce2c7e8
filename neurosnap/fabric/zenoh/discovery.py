"""Finds swarms on the network by id, and notices when one ends or resumes.

A swarm whose parts died goes on as another: as the next incarnation of its id, under
another prefix, since the numbers of its waves begin anew. ``demo`` goes on as
``demo-1``, ``demo-2`` and so on. A swarm is there while its coordinator is.
"""

import asyncio
from dataclasses import dataclass, field
from typing import Any, Self

import zenoh

from neurosnap import wire
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.fabric.zenoh.connect_session import reach
from neurosnap.fabric.zenoh.inbox import Inbox

_ALIVE = "alive/coordinator/*"


def incarnation(swarm: str, number: int) -> str:
    """Return the name on the wire of the swarm of an id, after so many restarts.

    Examples:
        >>> incarnation("demo", 0), incarnation("demo", 2)
        ('demo', 'demo-2')
    """
    return f"{swarm}-{number}" if number else swarm


def id_of(name: str) -> str:
    """Return the id of a swarm, given its name on the wire.

    Examples:
        >>> id_of("demo"), id_of("demo-2")
        ('demo', 'demo')
    """
    return name.partition("-")[0]


def is_of(name: str, swarm: str) -> bool:
    """Tell whether `name` is what some incarnation of `swarm` is called.

    Examples:
        >>> is_of("demo-2", "demo"), is_of("demo2", "demo"), is_of("demo-x", "demo")
        (True, False, False)
    """
    base, dash, number = name.partition("-")
    return base == swarm and number.isdecimal() == bool(dash)


@dataclass(eq=False)
class FoundSwarm:
    """A swarm that was found on the network."""

    name: str
    """What it is called on the wire."""
    gone: asyncio.Event = field(default_factory=asyncio.Event)
    """Set once its coordinator has gone."""


class Discovery:
    """Searches the network for swarms of one id; an async context manager.

    Args:
        swarm: The id.
        hub: Where the hub listens.
        stop: Ends the wait for the hub; then no swarm is seen.
        patience: Seconds to go on trying until the hub answers.
    """

    def __init__(
        self,
        swarm: str,
        hub: HubAddress,
        *,
        stop: asyncio.Event,
        patience: float,
    ) -> None:
        self._swarm = swarm
        self._hub = hub
        self._stop = stop
        self._patience = patience
        self._there: dict[str, FoundSwarm] = {}  # by name, in the order they came
        # The last that came, until it was returned.
        self._next: FoundSwarm | None = None
        self._came = asyncio.Event()

    async def __aenter__(self) -> Self:
        """Connect and look; say so where the hub is waited for.

        Raises:
            FabricError: The hub cannot be reached.
        """
        self._session = await reach("watcher", self._hub, self._stop, self._patience)
        if self._session is None:
            return self
        # Both ends of what this needs are here, so it cannot fail but by a bug.
        self._inbox: Inbox[tuple[str, bool]] = Inbox("watcher", self._receive, _raise)
        try:
            self._declared = await asyncio.to_thread(self._declare, self._session)
        except BaseException:
            await asyncio.to_thread(self._session.close)
            raise
        return self

    def _declare(self, session: zenoh.Session) -> Any:  # noqa: ANN401
        def hand_over(sample: zenoh.Sample) -> None:
            name = str(sample.key_expr).split("/")[1]
            self._inbox.push((name, sample.kind == zenoh.SampleKind.PUT))

        return session.liveliness().declare_subscriber(
            f"{wire.ROOT}/*/{_ALIVE}",
            zenoh.handlers.Callback(hand_over, indirect=False),
            history=True,
        )

    async def __aexit__(self, *_: object) -> None:
        """Stop looking and disconnect."""
        if self._session is None:
            return
        await asyncio.to_thread(self._declared.undeclare)
        self._inbox.close()
        await asyncio.to_thread(self._session.close)

    def _receive(self, changes: list[tuple[str, bool]]) -> None:
        """Note which coordinators came and went."""
        for name, alive in changes:
            if not is_of(name, self._swarm):
                continue
            if alive and name not in self._there:
                self._next = self._there[name] = FoundSwarm(name)
                self._came.set()
            elif not alive and name in self._there:
                self._there.pop(name).gone.set()

    async def next(
        self, stop: asyncio.Event, patience: float | None = None
    ) -> FoundSwarm | None:
        """Return the swarm that came last, once for each; None if `stop` was set.

        Args:
            stop: Ends the wait.
            patience: Seconds one may take to come; None if it may take any time.

        Raises:
            TimeoutError: None came.
        """
        async with asyncio.timeout(patience):
            while not stop.is_set():
                seen, self._next = self._next, None
                if seen is not None and not seen.gone.is_set():
                    return seen
                self._came.clear()
                await wait_any(self._came, stop)
        return None


def _raise(error: BaseException) -> None:
    raise error
