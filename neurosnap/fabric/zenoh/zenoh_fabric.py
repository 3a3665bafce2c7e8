"""The fabric over Zenoh: sends, receives, and flushes before it closes.

What keeps the promises of `neurosnap.fabric.protocol`: one session and one priority a
process; no callback that blocks, so that no receiver ever stalls the hub (what a
`light` handler puts in one fits Zenoh's queue); every put with BLOCK; callbacks run on
Zenoh's own receiving thread (``indirect=False``), which keeps the order across several
subscriptions. A running number and the sender's clock travel as the attachment.

How a session is configured is in `neurosnap.fabric.zenoh.connect_session`, what it
connects to in `neurosnap.fabric.zenoh.hub`.
"""

import asyncio
import ctypes
import struct
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack
from typing import Any, ParamSpec, Self, TypeVar

import zenoh

from neurosnap import wire
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.protocol import Handler, PresenceHandler
from neurosnap.fabric.roles import DESCRIPTION, FLUSHED
from neurosnap.fabric.wait_for_events import Failure
from neurosnap.fabric.zenoh.connect_session import LARGEST, connecting, reason_of
from neurosnap.fabric.zenoh.inbox import Inbox, Poll

P = ParamSpec("P")
T = TypeVar("T")
_BLOCK = zenoh.CongestionControl.BLOCK
_FLUSH = 5.0  # seconds the hub may take to have taken everything
_ANSWER = 10.0  # seconds others may take to answer
_PAUSE = 0.05  # seconds until one that is there is asked again
_CHANNEL = 1 << 20  # deliveries a polled subscription may hold back
_BESIDE = struct.Struct("<QQ")  # of a message: running number, sender's clock in ns


def _keep_thread_state() -> None:
    """Keep what Python knows of this thread of Zenoh's from one callback to the next.

    It is made and thrown away for each otherwise, with memory mapped and unmapped.
    """
    ctypes.pythonapi.PyGILState_Ensure()  # with no release, it outlives the callback


class ZenohFabric:
    """One process's end of a swarm's network.

    Args:
        who: The part's name, as in `Message.sender`.
        swarm: The run's id.
        hub: Where the hub listens, and what the part shows to it.
        first: The number of the first message; more than 0 where a run is resumed.
        patience: Seconds to go on trying until the hub answers.
        swift: Handlers run on a thread of their own, not on the event loop: a third
            off the time of a hop. For parts that share nothing with their loop.
        instance: Tells it from another part that has its name by mistake.
    """

    def __init__(
        self,
        who: str,
        swarm: str,
        hub: HubAddress,
        *,
        first: int = 0,
        patience: float = 60.0,
        swift: bool = False,
        instance: str = "0",
    ) -> None:
        self.who = who
        self._alive = f"{wire.ROOT}/{swarm}/alive/{who}/{instance}"
        self.sent = first
        self._prefix = f"{wire.ROOT}/{swarm}/"
        self._hub = hub
        self._patience = patience
        self._swift = swift
        # Delivery threads and the loop may publish at once; numbers must be unique.
        self._publishing = threading.Lock()
        self._declared: list[Any] = []
        self._inboxes: list[Inbox[Any]] = []
        self._polls: list[Poll] = []

    async def __aenter__(self) -> Self:
        """Open the session; FabricError if the hub cannot be reached."""
        self._failure = Failure()
        config = connecting(self._hub, self._patience)
        try:
            self._session = await self._off_loop(zenoh.open, config)
        except zenoh.ZError as error:
            rule = f"must reach the hub at {self._hub.endpoint}"
            got = reason_of(error)
            raise FabricError(f"{self.who}: {rule}, got {got}") from error
        return self

    async def _off_loop(
        self, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Make a blocking call: in a thread, or directly if the fabric is `swift`.

        Starting the thread would take one of the ten milliseconds that a cell needs
        to start.
        """
        if self._swift:
            return call(*args, **kwargs)
        return await asyncio.to_thread(call, *args, **kwargs)

    async def __aexit__(self, *_: object) -> None:
        """Stop receiving, hand over what waits, deliver what was sent, close."""
        # The stack calls back in reverse order and always completes: the session is
        # closed even if a handler raises.
        async with AsyncExitStack() as stack:
            stack.push_async_callback(self._off_loop, self._session.close)
            stack.push_async_callback(self._off_loop, self._flush)
            for inbox in self._inboxes:
                stack.push_async_callback(self._off_loop, inbox.close)
            for poll in self._polls:
                stack.callback(poll.finish)
            stack.push_async_callback(self._off_loop, self._undeclare)

    def _undeclare(self) -> None:
        for declared in reversed(self._declared):
            declared.undeclare()
        self._declared.clear()

    def _flush(self) -> None:
        """Return once the hub has taken all that was sent.

        Closing a session sometimes loses the last messages, if a large one is queued
        behind many small ones. A query is queued behind all of them, and the hub
        answers this one itself.
        """
        replies = self._session.get(
            f"{self._prefix}{FLUSHED}", congestion_control=_BLOCK, timeout=_FLUSH
        )
        for _ in replies:
            pass

    def publish(self, *messages: wire.Message) -> None:
        """Send `messages`, each under its key; blocks while the hub is congested."""
        # All are encoded first: puts without a pause between them leave in one frame.
        ready = [(message.key, wire.encode(message)) for message in messages]
        now = time.time_ns()
        with self._publishing:
            for key, payload in ready:
                self._put(wire.Delivery(key, self.sent, now, payload))
                self.sent += 1

    def forward(self, delivery: wire.Delivery) -> None:
        """Send a recorded delivery as it was; blocks like `publish`."""
        with self._publishing:
            self._put(delivery)

    def _put(self, delivery: wire.Delivery) -> None:
        key, number, sent, payload = delivery
        if len(payload) > wire.LARGEST_PAYLOAD:
            rule = f"must have at most {wire.LARGEST_PAYLOAD:,} bytes"
            raise FabricError(f"message on {key}: {rule}, got {len(payload):,}")
        self._session.put(
            self._prefix + key,
            payload,
            congestion_control=_BLOCK,
            attachment=_BESIDE.pack(number, sent),
        )

    def _read(self, sample: zenoh.Sample) -> wire.Delivery | None:
        """Return a delivery, copied out of Zenoh's hands; None if a stranger's."""
        beside = sample.attachment
        if beside is None or len(raw := beside.to_bytes()) != _BESIDE.size:
            return None
        key = str(sample.key_expr)[len(self._prefix) :]
        number, sent = _BESIDE.unpack(raw)
        return wire.Delivery(key, number, sent, sample.payload.to_bytes())

    async def subscribe(
        self,
        keys: Sequence[str],
        handler: Handler,
        *,
        poll: float | None = None,
        light: Callable[[], bool] | None = None,
    ) -> None:
        """Hand every message under `keys` to `handler`; see the protocol."""
        if poll is not None:
            channel: Any = zenoh.handlers.FifoChannel(_CHANNEL)
            (subscriber,) = await self._off_loop(self._declare, keys, channel)
            channel = subscriber.handler
            self._polls.append(Poll(channel, self._read, handler, poll, self._failure))
            return
        inbox = Inbox(
            self.who, handler, self._failure.set, swift=self._swift, light=light
        )
        self._inboxes.append(inbox)
        kept = set[int]() if light is not None else None

        def hand_over(sample: zenoh.Sample) -> None:
            if kept is not None and (thread := threading.get_ident()) not in kept:
                kept.add(thread)
                _keep_thread_state()
            delivery = self._read(sample)
            if delivery is not None:
                inbox.push(delivery)

        callback = zenoh.handlers.Callback(hand_over, indirect=False)
        await self._off_loop(self._declare, keys, callback)

    def _declare(self, keys: Sequence[str], handler: Any) -> list[Any]:  # noqa: ANN401
        """Declare all in one go: a thousand cells do this at once."""
        subscribers = [
            self._session.declare_subscriber(self._prefix + key, handler)
            for key in keys
        ]
        self._declared.extend(subscribers)
        return subscribers

    async def announce(self) -> None:
        """Declare the liveliness token ``alive/<who>/<instance>``."""
        declare = self._session.liveliness().declare_token
        token = await self._off_loop(declare, self._alive)
        self._declared.append(token)

    async def confirm(self) -> None:
        """Wait until the hub has what was declared here; see the protocol.

        The part's own hub. Another that is linked to it has it by the time it shows
        this part's presence. A hub takes what one session sends in order, so its answer
        to a query comes after the declarations.
        """
        key, get = self._alive, self._session.liveliness().get

        def ask() -> bool:
            # Where no part is alive by that name there is an end and no reply.
            return all(
                reply.ok is not None for reply in get(key, timeout=self._patience)
            )

        if not await self._off_loop(ask):
            raise FabricError(f"hub: must answer within {self._patience:g} s")

    async def present(self) -> set[str]:
        """Return the parts that are there now."""
        prefix = f"{self._prefix}alive/"
        get = self._session.liveliness().get

        def look() -> set[str]:
            found = (reply.ok for reply in get(f"{prefix}**", timeout=_ANSWER))
            keys = [str(one.key_expr)[len(prefix) :] for one in found if one]
            return {key.rpartition("/")[0] for key in keys}

        return await self._off_loop(look)

    async def describe_run(self, content: bytes) -> None:
        """Answer queries for the run's description with `content`. For coordinators.

        Raises:
            InvalidValueError: It is larger than any session takes in.
        """
        if len(content) >= LARGEST:
            rule = f"must fit into a message of {LARGEST:,} bytes"
            raise InvalidValueError("description", rule, len(content))
        key = f"{self._prefix}{DESCRIPTION}"

        def answer(query: zenoh.Query) -> None:
            query.reply(key, content)

        self._declared.append(
            await self._off_loop(self._session.declare_queryable, key, answer)
        )

    async def ask(self) -> bytes | None:
        """Return the coordinator's description of the run; None if it has gone.

        Where hubs were linked a moment ago, a coordinator may be seen through the new
        link before it can be asked.
        """

        def get() -> bytes | None:
            for reply in self._session.get(
                f"{self._prefix}{DESCRIPTION}", timeout=_ANSWER
            ):
                if reply.ok is not None:
                    return reply.ok.payload.to_bytes()
            return None

        until = time.monotonic() + _ANSWER
        content = await self._off_loop(get)
        while content is None and "coordinator" in await self.present():
            if time.monotonic() > until:
                break
            await asyncio.sleep(_PAUSE)
            content = await self._off_loop(get)
        return content

    async def watch(self, handler: PresenceHandler) -> None:
        """Follow the liveliness tokens, those already there included."""
        prefix = f"{self._prefix}alive/"
        there: dict[str, dict[str, None]] = {}  # the keys of a name, as they came

        def deliver(changes: list[tuple[str, bool]]) -> None:
            for key, alive in changes:
                name = key.rpartition("/")[0]
                keys = there.setdefault(name, {})
                is_first = next(iter(keys), key) == key
                keys[key] = None
                if not alive:
                    del keys[key]
                after = name if alive else next(iter(keys), name)  # in its place
                handler(after if is_first else key, alive)

        inbox: Inbox[tuple[str, bool]] = Inbox(self.who, deliver, self._failure.set)
        self._inboxes.append(inbox)

        def hand_over(sample: zenoh.Sample) -> None:
            alive = sample.kind == zenoh.SampleKind.PUT
            inbox.push((str(sample.key_expr)[len(prefix) :], alive))

        self._declared.append(
            await self._off_loop(
                self._session.liveliness().declare_subscriber,
                f"{prefix}**",
                zenoh.handlers.Callback(hand_over, indirect=False),
                history=True,
            )
        )

    async def serve(self, stop: asyncio.Event) -> None:
        """Wait until `stop` is set; raise what a handler raised before that."""
        await self._failure.wait(stop)

    def fail(self, error: BaseException) -> None:
        """Make `serve` raise `error`."""
        self._failure.set(error)
