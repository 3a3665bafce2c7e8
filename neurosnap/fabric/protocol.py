"""The protocol that both fabrics implement, and its guarantees.

- One sender's messages arrive at one receiver in the order it published them.
- Nothing is promised between different senders.
- A message is lost only with an error or with a gap in its sender's running numbers.

Handlers are plain functions that get a burst of deliveries: a pulse needs neither an
``await`` nor a task, and either would cost more than the work. They run on the event
loop's thread, unless a part asked for a swift fabric: then each subscription has a
thread of its own for them. What such a handler shares with the loop, or with a handler
of another subscription, needs a lock. Handlers of presence run on the loop always.
"""

import asyncio
from collections.abc import Callable, Sequence
from typing import Protocol, Self

from neurosnap import wire

Handler = Callable[[list[wire.Delivery]], None]
PresenceHandler = Callable[[str, bool], None]


class Fabric(Protocol):
    """One part's end of the network. Entering opens it, leaving closes it."""

    @property
    def who(self) -> str:
        """The part's name, as in `Message.sender`."""

    def publish(self, *messages: wire.Message) -> None:
        """Send `messages` in order, each under its key.

        May block while the network is congested.
        """

    async def subscribe(
        self,
        keys: Sequence[str],
        handler: Handler,
        *,
        poll: float | None = None,
        light: Callable[[], bool] | None = None,
    ) -> None:
        """Hand every message under `keys` to `handler`, in bursts.

        Args:
            keys: Key expressions below the swarm's prefix: ``*`` is any one chunk,
                ``**`` any number of them.
            handler: Called on the thread the module names. What it raises comes out of
                `serve`.
            poll: Collect for this many seconds rather than waking at once, for those
                who need throughput and not latency. On the event loop, always. Under
                one key only: what is collected under each is apart from the others, so
                no sender's order would be kept.
            light: Tells that what the handler publishes next surely fits the queue of
                what is sent. Then a swift fabric may call it on the thread that
                receives, still one burst at a time, and no thread has to be woken.
        """

    async def announce(self) -> None:
        """Show this part as alive, after all its subscriptions are in place."""

    async def confirm(self) -> None:
        """Wait until every message published on this hub from now on comes here.

        A declaration takes its time to the hub. Who waits for another part's presence
        need not ask for this: what that part declared before is in force by then, on
        the waiting part's hub too if that is another.

        Raises:
            FabricError: The hub does not answer.
        """

    async def present(self) -> set[str]:
        """Return the names of the parts that are there now."""

    async def describe_run(self, content: bytes) -> None:
        """Answer every part that asks what the run is with `content`."""

    async def ask(self) -> bytes | None:
        """Return what the coordinator describes the run as; None if it is gone."""

    async def watch(self, handler: PresenceHandler) -> None:
        """Call ``handler(who, alive)`` of each part; a second is ``who/instance``."""

    async def serve(self, stop: asyncio.Event) -> None:
        """Wait until `stop` is set; raise what a handler raised before that."""

    def fail(self, error: BaseException) -> None:
        """Make `serve` raise `error`, unless it already has one to raise."""

    async def __aenter__(self) -> Self: ...

    async def __aexit__(self, *_: object) -> None: ...
