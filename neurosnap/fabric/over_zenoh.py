"""The fabric over Zenoh: one session a process, nothing found by chance.

What keeps the promises of `neurosnap.fabric.protocol`: one session and one priority a
process; no callback that blocks, so that no receiver ever stalls the hub; every put
with BLOCK; callbacks run on Zenoh's own receiving thread (``indirect=False``), which
keeps the order across several subscriptions. A running number and the sender's clock
travel as the attachment.

Without credentials it stays on this machine; with them every link is mutual TLS, and
the hub passes on only what `neurosnap.fabric.access` allows.
"""

import asyncio
import json
import struct
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack
from types import TracebackType
from typing import Any, ParamSpec, Self, TypeVar

import zenoh

from neurosnap import wire
from neurosnap.errors import FabricError
from neurosnap.fabric.access import FLUSHED, access_list
from neurosnap.fabric.credentials import Credentials
from neurosnap.fabric.endpoint import check_endpoint
from neurosnap.fabric.inbox import Courier, Door, Inbox
from neurosnap.fabric.protocol import Failure, Handler, PresenceHandler

P = ParamSpec("P")
T = TypeVar("T")

_BESIDE = struct.Struct("<QQ")  # running number, sender's clock in ns
_BLOCK = zenoh.CongestionControl.BLOCK
_FLUSH = 5.0  # seconds the hub may take to have taken everything
_CHANNEL = 1 << 20  # deliveries a polled subscription may hold back
_CHUNK = 4096  # deliveries handled before other tasks get their turn


def configuration(mode: str, **settings: object) -> zenoh.Config:
    """Return a Zenoh configuration that listens to nobody and looks for nobody.

    Args:
        mode: ``client`` or ``router``.
        settings: More of Zenoh's keys, ``__`` for ``/``; values as JSON can say them.
    """
    config = zenoh.Config()
    defaults: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        # On, no more than some 350 sessions connect to one router.
        "transport/shared_memory/enabled": False,
    }
    named = {key.replace("__", "/"): value for key, value in settings.items()}
    for key, value in (defaults | named).items():
        config.insert_json5(key, json.dumps(value))
    return config


def open_hub(
    endpoints: Sequence[str],
    sessions: int,
    *,
    credentials: Credentials | None = None,
    insecure: bool = False,
) -> zenoh.Session:
    """Open the router all parts of a swarm connect to. Blocks; close it when done.

    Args:
        endpoints: What it listens on.
        sessions: How many parts will connect.
        credentials: The hub's; turns on mutual TLS and the access list.
        insecure: May listen beyond this machine without credentials.

    Raises:
        InvalidValueError: An endpoint breaks the rule of `check_endpoint`.
        FabricError: An endpoint is in use or cannot be listened on.
    """
    for endpoint in endpoints:
        check_endpoint(endpoint, tls=credentials is not None, insecure=insecure)
    guard: dict[str, object] = {}
    if credentials is not None:
        guard = {
            "transport__link__tls": credentials.to_listen(),
            "access_control": access_list(),
        }
    try:
        return zenoh.open(
            configuration(
                "router",
                listen__endpoints=list(endpoints),
                transport__unicast__max_sessions=sessions + 100,
                transport__unicast__accept_pending=sessions + 100,
                # A stalled part must not get its link closed and lose what waits.
                transport__link__tx__queue__congestion_control__block__wait_before_close=60_000_000,
                **guard,
            )
        )
    except zenoh.ZError as error:
        raise FabricError(
            f"hub: must be able to listen on {', '.join(endpoints)}, got {error}"
        ) from error


class ZenohFabric:
    """One process's end of a swarm's network.

    Args:
        who: The part's name, as in `Message.sender`.
        swarm: The run's id.
        endpoint: Where the hub listens.
        first: The number of the first message; more than 0 where a run is resumed.
        patience: Seconds to go on trying until the hub answers.
        swift: Handlers run on a thread of their own, not on the event loop: a third
            off the time of a hop. For parts that share nothing with their loop.
        credentials: The part's, where the hub has some.
        insecure: May connect beyond this machine without credentials.

    Raises:
        InvalidValueError: The endpoint breaks the rule of `check_endpoint`.
    """

    def __init__(
        self,
        who: str,
        swarm: str,
        endpoint: str,
        *,
        first: int = 0,
        patience: float = 60.0,
        swift: bool = False,
        credentials: Credentials | None = None,
        insecure: bool = False,
    ) -> None:
        check_endpoint(endpoint, tls=credentials is not None, insecure=insecure)
        self.who = who
        self.sent = first
        self._prefix = f"{wire.ROOT}/{swarm}/"
        self._endpoint = endpoint
        self._patience = patience
        self._swift = swift
        self._credentials = credentials
        # A courier and the loop may publish at once; a number must not be used twice.
        self._publishing = threading.Lock()
        self._declared: list[Any] = []
        self._doors: list[Door[Any]] = []
        self._polls: list[_Poll] = []

    async def __aenter__(self) -> Self:
        """Open the session.

        Raises:
            FabricError: The hub cannot be reached.
        """
        self._failure = Failure()
        try:
            self._session = await self._off_loop(zenoh.open, self._config())
        except zenoh.ZError as error:
            raise FabricError(
                f"{self.who}: must reach the hub at {self._endpoint}, got {error}"
            ) from error
        return self

    async def _off_loop(
        self, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Make a call that blocks; aside, unless the loop has nothing else to do.

        A thread to call from costs a process a millisecond to start, of the ten a cell
        takes in all.
        """
        if self._swift:
            return call(*args, **kwargs)
        return await asyncio.to_thread(call, *args, **kwargs)

    def _config(self) -> zenoh.Config:
        guard: dict[str, object] = {}
        if self._credentials is not None:
            guard["transport__link__tls"] = self._credentials.to_connect()
        return configuration(
            "client",
            connect__endpoints=[self._endpoint],
            connect__timeout_ms=int(self._patience * 1000),
            connect__retry={
                "period_init_ms": 50,
                "period_max_ms": 200,
                "period_increase_factor": 1.5,
            },
            transport__link__tx__queue__congestion_control__block__wait_before_close=60_000_000,
            **guard,
        )

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop receiving, hand over what waits, deliver what was sent, close."""
        # A stack runs backwards, and to its end: whatever a handler raises at the last
        # moment, the session is closed.
        async with AsyncExitStack() as stack:
            stack.push_async_callback(self._off_loop, self._session.close)
            stack.push_async_callback(self._off_loop, self._flush)
            for door in self._doors:
                stack.push_async_callback(self._off_loop, door.close)
            for poll in self._polls:
                stack.callback(poll.finish)
            stack.push_async_callback(self._off_loop, self._undeclare)

    def _undeclare(self) -> None:
        for declared in reversed(self._declared):
            declared.undeclare()
        self._declared.clear()

    def _flush(self) -> None:
        """Return once the hub has taken all that was sent.

        Closing a session loses the end now and then, where a large message waits
        behind many small ones. A query travels behind them, as one of them, and the
        hub answers this one itself.
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
                self._put(key, payload, self.sent, now)
                self.sent += 1

    def forward(self, delivery: wire.Delivery) -> None:
        """Send what somebody else sent, as it was; blocks like `publish`."""
        self._put(delivery.key, delivery.payload, delivery.sequence, delivery.sent)

    def _put(self, key: str, payload: bytes, sequence: int, sent: int) -> None:
        self._session.put(
            self._prefix + key,
            payload,
            congestion_control=_BLOCK,
            attachment=_BESIDE.pack(sequence, sent),
        )

    async def subscribe(
        self, keys: Sequence[str], handler: Handler, *, poll: float | None = None
    ) -> None:
        """Hand every message under `keys` to `handler`; see the protocol."""
        cut = len(self._prefix)
        if poll is not None:
            channel: Any = zenoh.handlers.FifoChannel(_CHANNEL)
            for subscriber in await self._off_loop(self._declare, keys, channel):
                self._polls.append(
                    _Poll(subscriber.handler, cut, handler, poll, self._failure)
                )
            return
        kind = Courier if self._swift else Inbox
        door: Door[wire.Delivery] = kind(self.who, handler, self._failure.set)
        self._doors.append(door)

        def hand_over(sample: zenoh.Sample) -> None:
            delivery = _delivery(sample, cut)
            if delivery is not None:
                door.push(delivery)

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
        """Declare the liveliness token ``alive/<who>``."""
        self._declared.append(
            await self._off_loop(
                self._session.liveliness().declare_token,
                f"{self._prefix}alive/{self.who}",
            )
        )

    async def watch(self, handler: PresenceHandler) -> None:
        """Follow the liveliness tokens, those already there included."""
        cut = len(f"{self._prefix}alive/")

        def deliver(changes: list[tuple[str, bool]]) -> None:
            for who, alive in changes:
                handler(who, alive)

        inbox: Inbox[tuple[str, bool]] = Inbox(self.who, deliver, self._failure.set)
        self._doors.append(inbox)

        def hand_over(sample: zenoh.Sample) -> None:
            alive = sample.kind == zenoh.SampleKind.PUT
            inbox.push((str(sample.key_expr)[cut:], alive))

        self._declared.append(
            await self._off_loop(
                self._session.liveliness().declare_subscriber,
                f"{self._prefix}alive/**",
                zenoh.handlers.Callback(hand_over, indirect=False),
                history=True,
            )
        )

    async def serve(self, stop: asyncio.Event) -> None:
        """Wait until `stop` is set; raise what a handler raised before that."""
        await self._failure.wait(stop)

    def fail(self, error: BaseException) -> None:
        """Let `serve` raise `error`."""
        self._failure.set(error)


class _Poll:
    """Empties a channel every so often, for readers that need rate and not latency.

    The samples wait in Zenoh's own channel, which costs neither a thread nor the GIL. A
    full channel holds back the hub, and so the senders: a slow reader slows the run
    down and loses nothing.
    """

    def __init__(
        self,
        channel: zenoh.Handler[zenoh.Sample],
        cut: int,
        handler: Handler,
        every: float,
        failure: Failure,
    ) -> None:
        self._channel = channel
        self._cut = cut
        self._handler = handler
        self._every = every
        self._failure = failure
        self._loop = asyncio.get_running_loop()
        self._timer = self._loop.call_later(every, self._turn)

    def _turn(self) -> None:
        try:
            more = self._drain()
        except BaseException as error:  # noqa: BLE001 - goes on to `serve`, whole
            self._failure.set(error)
            return
        self._timer = self._loop.call_later(0.0 if more else self._every, self._turn)

    def _drain(self) -> bool:
        """Hand over up to a chunk of deliveries; tell whether more may wait."""
        samples: list[zenoh.Sample] = []
        while len(samples) < _CHUNK:
            try:
                sample = self._channel.try_recv()
            except zenoh.ZError:  # empty, and closed for good
                break
            if sample is None:
                break
            samples.append(sample)
        found = (_delivery(sample, self._cut) for sample in samples)
        burst = [delivery for delivery in found if delivery is not None]
        if burst:
            self._handler(burst)
        return len(samples) == _CHUNK

    def finish(self) -> None:
        """Hand over the rest, unless the part has failed.

        Called once nothing more can arrive.
        """
        self._timer.cancel()
        while not self._failure.happened and self._drain():
            pass


def _delivery(sample: zenoh.Sample, cut: int) -> wire.Delivery | None:
    """Copy a sample out of Zenoh's hands; None for a stranger's."""
    beside = sample.attachment
    if beside is None:
        return None
    raw = beside.to_bytes()
    if len(raw) != _BESIDE.size:
        return None
    number, sent = _BESIDE.unpack(raw)
    return wire.Delivery(
        str(sample.key_expr)[cut:], number, sent, sample.payload.to_bytes()
    )
