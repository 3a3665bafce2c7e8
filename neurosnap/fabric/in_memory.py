"""The in-memory fabric, for swarms in one process and for simulation.

Every message is delivered in the order it was published; a simulation draws another
order, and faults, by overriding what is said to be for it.

The hub is synchronous. Simulations call `step` themselves; where a loop is running, the
hub delivers as part of it.
"""

import asyncio
import contextlib
import functools
import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from typing import Self

import zenoh

from neurosnap import wire
from neurosnap.fabric.protocol import Handler, PresenceHandler
from neurosnap.fabric.wait_for_events import Failure

_TURN = 256  # deliveries before other tasks of the loop get their turn


@functools.lru_cache(maxsize=1 << 16)
def matches(expression: str, key: str) -> bool:
    """Tell whether `key` is one of those that `expression` stands for in Zenoh."""
    return zenoh.KeyExpr(expression).includes(zenoh.KeyExpr(key))


class MemoryHub:
    """Connects the `MemoryFabric` ends of one swarm."""

    def __init__(self) -> None:
        self.description: bytes | None = None
        """What the coordinator describes the run as."""
        self._links: defaultdict[tuple[str, str], deque[wire.Delivery]]
        self._links = defaultdict(deque)
        self._queue: deque[tuple[str, str]] = deque()
        self._routes: dict[str, dict[str, list[Handler]]] = {}
        self._by_topic: dict[str, list[tuple[str, str, Handler]]] = {}
        self._subscriptions: list[tuple[str, str, Handler]] = []
        self._watchers: list[tuple[str, PresenceHandler]] = []
        self._alive: list[str] = []
        self._ends: dict[str, MemoryFabric] = {}
        self._pumping = False

    def fabric(self, who: str, *, first: int = 0) -> "MemoryFabric":
        """Return the end of part `who`, its messages numbered from `first`."""
        end = MemoryFabric(self, who, first)
        self._ends[who] = end
        return end

    @property
    def present(self) -> set[str]:
        """The names of the parts that are there."""
        return set(self._alive)

    @property
    def pending(self) -> int:
        """How many deliveries are under way."""
        return len(self._queue)

    def step(self) -> bool:
        """Deliver one message; tell whether there was one.

        Raises:
            Exception: Whatever the receiving handler raises.
        """
        taken = self._next_delivery()
        if taken is None:
            return False
        self._hand_over(*taken)
        return True

    def _next_delivery(self) -> tuple[str, wire.Delivery] | None:
        """Return the next receiver and what it gets."""
        if not self._queue:
            return None
        link = self._next_link()
        return link[1], self._next_on(link)

    def _next_link(self) -> tuple[str, str]:
        """Return the link that delivers next; a simulation may draw another."""
        return self._queue.popleft()

    def _next_on(self, link: tuple[str, str]) -> wire.Delivery:
        """Return what a link delivers next; a simulation may let it come again."""
        return self._links[link].popleft()

    def _hand_over(self, receiver: str, delivery: wire.Delivery) -> None:
        for handler in self._route(delivery.key).get(receiver, ()):
            handler([delivery])

    def _route(self, key: str) -> dict[str, list[Handler]]:
        """Return who listens to `key`; remembered, since keys come again and again."""
        route = self._routes.get(key)
        if route is None:
            route = self._routes[key] = {}
            for who, expression, handler in self._listening(wire.topic(key)):
                if matches(expression, key):
                    route.setdefault(who, []).append(handler)
        return route

    def _listening(self, topic: str) -> list[tuple[str, str, Handler]]:
        """Return the subscriptions that a key of `topic` may match.

        There is a key for each two cells, and each cell has several subscriptions.
        """
        found = self._by_topic.get(topic)
        if found is None:
            mine = (topic, "*", "**")
            found = self._by_topic[topic] = [
                one for one in self._subscriptions if wire.topic(one[1]) in mine
            ]
        return found

    def _changed(self) -> None:
        """Forget who listens to what."""
        self._routes.clear()
        self._by_topic.clear()

    def send(self, sender: str, delivery: wire.Delivery) -> None:
        """Send a delivery to every subscriber of its key."""
        for receiver in self._route(delivery.key):
            link = (sender, receiver)
            if self._loses(link):
                continue
            self._links[link].append(delivery)
            self._queue.append(link)
        self._pump_soon()

    def _loses(self, _link: tuple[str, str]) -> bool:
        """Tell whether a message is lost on its way; in a simulation it may be."""
        return False

    def listen(self, who: str, expression: str, handler: Handler) -> None:
        """Add a subscription."""
        self._subscriptions.append((who, expression, handler))
        self._changed()

    def _hand_nothing_to(self, who: str) -> None:
        """Forget the subscriptions of a part."""
        self._subscriptions = [s for s in self._subscriptions if s[0] != who]
        self._changed()

    def leave(self, who: str) -> None:
        """Take a part off the network: its subscriptions, its presence, its mail."""
        self._hand_nothing_to(who)
        self._watchers = [w for w in self._watchers if w[0] != who]
        for link in {link for link in self._queue if link[1] == who}:
            del self._links[link]
        self._queue = deque(link for link in self._queue if link[1] != who)
        if who in self._alive:
            self._alive.remove(who)
            for _, handler in self._watchers:
                handler(who, False)

    def announce(self, who: str) -> None:
        """Announce the part `who` as alive to all watchers."""
        self._alive.append(who)
        for _, handler in self._watchers:
            handler(who, True)

    def watch(self, who: str, handler: PresenceHandler) -> None:
        """Call `handler` for each part that is there, and each that comes or goes."""
        self._watchers.append((who, handler))
        for present in list(self._alive):
            handler(present, True)

    def _pump_soon(self) -> None:
        if self._pumping:
            return
        with contextlib.suppress(RuntimeError):  # no loop: the simulation steps itself
            asyncio.get_running_loop().call_soon(self._pump)
            self._pumping = True

    def _pump(self) -> None:
        self._pumping = False
        for _ in range(_TURN):
            taken = self._next_delivery()
            if taken is None:
                return
            try:
                self._hand_over(*taken)
            except BaseException as error:  # noqa: BLE001 - goes to the part it is of
                self._hand_nothing_to(taken[0])
                self._ends[taken[0]].fail(error)
        self._pump_soon()


class MemoryFabric:
    """One part's end of a `MemoryHub`; see `neurosnap.fabric.protocol`."""

    def __init__(self, hub: MemoryHub, who: str, first: int = 0) -> None:
        self.who = who
        self.sent = first
        self._hub = hub
        self._failure: Failure | None = None

    async def __aenter__(self) -> Self:
        """Nothing needs opening."""
        self._failure = Failure()
        return self

    async def __aexit__(self, *_: object) -> None:
        """Leave the network."""
        self._hub.leave(self.who)

    def publish(self, *messages: wire.Message) -> None:
        """Send `messages`, each under its key."""
        for message in messages:
            payload = wire.encode(message)
            delivery = wire.Delivery(message.key, self.sent, time.time_ns(), payload)
            self.sent += 1
            self._hub.send(self.who, delivery)

    def listen(self, keys: Sequence[str], handler: Handler) -> None:
        """Subscribe without a loop, for simulations."""
        for key in keys:
            self._hub.listen(self.who, key, handler)

    async def subscribe(
        self,
        keys: Sequence[str],
        handler: Handler,
        *,
        poll: float | None = None,
        light: Callable[[], bool] | None = None,
    ) -> None:
        """Hand every message under `keys` to `handler`; there is no waiting here."""
        self.listen(keys, handler)

    async def announce(self) -> None:
        """Show this part as alive."""
        self._hub.announce(self.who)

    async def confirm(self) -> None:
        """Do nothing: what is declared is in force at once."""

    async def present(self) -> set[str]:
        """Return the names of the parts that are there now."""
        return self._hub.present

    async def describe_run(self, content: bytes) -> None:
        """Answer every part that asks what the run is with `content`."""
        self._hub.description = content

    async def ask(self) -> bytes | None:
        """Return what the coordinator describes the run as; None if it does not."""
        return self._hub.description

    async def watch(self, handler: PresenceHandler) -> None:
        """Call ``handler(who, alive)`` for every part that is there, comes or goes."""
        self._hub.watch(self.who, handler)

    async def serve(self, stop: asyncio.Event) -> None:
        """Wait until `stop` is set; raise what a handler raised before that."""
        if self._failure is None:
            raise RuntimeError("serve: must be called inside the fabric's context")
        await self._failure.wait(stop)

    def fail(self, error: BaseException) -> None:
        """Make `serve` raise `error`."""
        if self._failure is not None:
            self._failure.set(error)
