"""An MQTT connection that reconnects, resubscribes and republishes.

Every connection is a client of its own: what has to be sent is in the `Outbox`, what
was retained comes with the subscriptions, and the client library's own leftovers of a
broken connection cannot mix with the next one. With a session the broker takes them for
one client, which may be another process each time. While that is away it keeps for it
what is published with QoS 1, as many messages as it is configured to, and for `KEPT`
seconds; with QoS 0 it keeps nothing.

Messages are handed over inside the library's callback, not queued: its queue, when
full, drops the *newest* message, after the broker has been told that it arrived. That
is told once the callback has returned. What a receiver raises ends the connection, and
the broker sends the message again on the next one. So it may come twice.

A broker may send all that it kept, tens of thousands of messages, before it answers
anything. So an answer is given up when nothing comes, not when it takes long.

What is wrong at the start is an error: a refused name or password and a certificate
that is not trusted at once, anything else when the patience is over. Once connected, a
link never gives up. It says so once an outage, and when the reason changes. One that
only publishes leaves that to the one of its run that listens.
"""

import asyncio
import logging
import math
import random
import secrets
import ssl
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import aiomqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.fabric.wait_for_events import first_of, wait_any
from neurosnap.sources.mqtt.options import MqttBroker
from neurosnap.sources.mqtt.outbox import TOGETHER, Outbox, Outgoing

ONLINE, OFFLINE = b"online", b"offline"
SHORTEST, LONGEST = 0.5, 30.0
"""Seconds before the first and the last attempt to connect again, before jitter."""
KEPT = 12 * 3600
"""Seconds for which a broker keeps what a session misses."""
_REFUSED = {134, 135}  # name or password; paho says so for 4 and 5 of MQTT 3.1.1, too
_OLD = 132  # the version of MQTT is not spoken; paho says so for 1 of MQTT 3.1.1, too
_UNDERWAY = 1 << 15
"""Messages not acknowledged, if the broker heeds it: few others wait, of more it drops
some. So these are how far a run may fall behind: 16 s of 2,000 a second."""
_ANSWER = 5.0  # seconds a broker may be silent that owes an answer
_DRAIN = 2.0  # seconds an orderly end may take to send what waits
_SILENCE = 30  # seconds after which each side asks whether the other is there
_KEEPS_NOTHING = (
    "%s: speaks no MQTT 5, so it keeps nothing of what comes while this run is away"
)
_logger = logging.getLogger(__name__)
Receive: TypeAlias = Callable[[str, bytes, bool], None]
"""Takes topic, payload, and whether the broker had kept it."""


class MqttLink:
    """A client of an MQTT broker that reconnects by itself.

    Args:
        broker: Where it is.
        role: What its client ids say. The rest is drawn: of two clients with the same
            id a broker drops one.
        status: A topic that says ``online`` while it is connected and ``offline``
            otherwise, retained, by a last will if need be; None if there is none.
        filters: What to subscribe to, with QoS 1.
        receive: Takes what comes; is called in the loop of `serve`, must be quick, and
            raises only where it must be sent again.
        connected: Is told that it is subscribed or that a message came, and that it no
            longer is; likewise.
        session: What the broker knows the client by, on every connection; empty if it
            is to keep nothing. Where it speaks no MQTT 5 it keeps nothing.

    Raises:
        InvalidValueError: The certificates to trust cannot be read, or the password.
    """

    def __init__(
        self,
        broker: MqttBroker,
        role: str,
        *,
        status: str | None = None,
        filters: Sequence[str] = (),
        receive: Receive | None = None,
        connected: Callable[[bool], None] = lambda _: None,
        session: str = "",
    ) -> None:
        self._broker = broker
        self._role = role
        self._status = status
        self._filters = tuple(dict.fromkeys(filters))
        self._receive = receive
        self._connected = connected
        self._known_as = session
        self._trust = _trust(broker)
        broker.password()  # a secret that is not there is found out before anything runs
        self._lock = threading.Lock()  # around the outbox and the loop
        self._outbox = Outbox()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting = asyncio.Event()
        self._level = logging.WARNING if filters else logging.INFO
        self._said = ""  # what is wrong, while the connection is away
        self._told = self._came = 0
        self._was_connected = self._forget = False

    def hold(self, topic: str, payload: bytes) -> None:
        """Publish `payload` on `topic`, retained, from now on; from any thread."""
        with self._lock:
            if self._outbox.hold(topic, payload):
                self._wake()

    def send(self, message: Outgoing) -> None:
        """Send `message` if that can be done soon; from any thread, without waiting."""
        with self._lock:
            self._outbox.send(message, time.monotonic())
            self._wake()

    def forget(self) -> None:
        """Let the broker keep nothing once `serve` has ended; from any thread."""
        self._forget = True

    def go_on(self) -> None:
        """Never give up, as if it had been connected; to be called before `serve`."""
        self._was_connected = True

    async def serve(self, stop: asyncio.Event) -> None:
        """Stay connected until `stop` is set, then send what waits and say goodbye.

        Raises:
            InvalidValueError: At the start: the broker refuses the name or the
                password, or a filter, or its certificate is not trusted.
            NeurosnapError: At the start: it cannot be reached within the patience.
        """
        with self._lock:
            self._loop = asyncio.get_running_loop()
        began, delay = time.monotonic(), 0.0
        try:
            while not stop.is_set():
                since = time.monotonic()
                try:
                    await self._session(stop)
                except (aiomqtt.MqttError, InvalidValueError) as error:
                    _close_failed_socket(error)
                    now = time.monotonic()
                    if self._known_as and _code(error) == _OLD:
                        self._known_as = ""
                        _logger.warning(_KEEPS_NOTHING, self._broker.address)
                        continue
                    if not self._was_connected and not stop.is_set():
                        late = now - began >= self._broker.patience
                        give_up(self._broker, error, late=late)
                    self._log_trouble(error)
                    delay = delay_after(delay, error, now - since)
                    # Shortened by up to a half, so that clients part.
                    await wait_any(stop, seconds=delay * random.uniform(0.5, 1.0))
        finally:
            with self._lock:
                self._loop = None

    async def _session(self, stop: asyncio.Event) -> None:
        """Be connected once, until `stop` is set."""
        try:
            async with self._client() as client, asyncio.TaskGroup() as group:
                # Listening comes first and ends last: only who listens hears at once
                # that the connection broke, whatever else is being waited for.
                listening = group.create_task(_listen(client), name="mqtt/listen")
                if self._filters:
                    await first_of(self._subscribe(client), self._quiet(), stop.wait())
                if not (self._filters and stop.is_set()):
                    await self._greet(client, stop)
                    send = self._send(client, stop)
                    sending = group.create_task(send, name="mqtt/send")
                    await stop.wait()
                    self._waiting.set()  # to be looked at once more, and so to end
                    await self._leave(client, sending)
                if self._known_as and self._forget:
                    client.disconnect_for_good()
                listening.cancel()
        except ExceptionGroup as group_error:
            raise _first(group_error) from None
        finally:
            self._came = 0
            self._connected(False)

    async def _quiet(self) -> None:
        """Fail once no message has come for too long."""
        came = -1
        while came != (came := self._came):  # noqa: ASYNC110 - there is no event
            await asyncio.sleep(_ANSWER)
        raise aiomqtt.MqttError("Operation timed out")

    def _take(self, message: aiomqtt.Message) -> None:
        """Hand over a message, be the subscription answered or not."""
        if not self._came:
            self._connected(True)
        self._came += 1
        if self._receive is not None:
            self._receive(message.topic.value, message.payload, message.retain)

    async def _greet(self, client: "_Client", stop: asyncio.Event) -> None:
        """Say ``online``, and let all that is held be sent again."""
        client.pending_calls_threshold = TOGETHER
        self._connected(True)
        if self._status is not None:
            online = Outgoing(self._status, ONLINE, retain=True)
            saying = self._publish_one(client, online)
            await first_of(saying, self._quiet(), stop.wait())
        with self._lock:
            self._outbox.renew()
        self._was_connected = True
        if self._said:
            _logger.log(self._level, "%s: connected", self._broker.address)
            self._said = ""

    def _client(self) -> "_Client":
        """Return a client for one connection."""
        broker, lasting = self._broker, dict[str, Any]()
        if self._known_as:
            kept = Properties(PacketTypes.CONNECT)
            kept.SessionExpiryInterval = KEPT
            kept.ReceiveMaximum = _UNDERWAY
            five = aiomqtt.ProtocolVersion.V5
            lasting = {"protocol": five, "clean_start": False, "properties": kept}
        will = None
        if self._status is not None:
            will = aiomqtt.Will(self._status, OFFLINE, qos=1, retain=True)
        return _Client(
            broker.host,
            broker.resolved_port,
            username=broker.username,
            password=broker.password(),
            identifier=f"neurosnap-{self._role}-{self._known_as or secrets.token_hex(4)}",
            queue_type=_handing_to(self._take),
            will=will,
            timeout=_ANSWER,
            keepalive=_SILENCE,
            tls_context=self._trust,
            **lasting,
        )

    async def _subscribe(self, client: aiomqtt.Client) -> None:
        wanted = [(each, 1) for each in self._filters]
        answers = await client.subscribe(wanted, timeout=math.inf)
        for topic, answer in zip(self._filters, answers, strict=True):
            if isinstance(answer, ReasonCode) and answer.is_failure:
                rule = "must be a filter that the broker grants"
                raise InvalidValueError("topic", rule, topic)

    async def _send(self, client: aiomqtt.Client, stop: asyncio.Event) -> None:
        """Send what waits and what comes, in batches; end with one, after `stop`."""
        while not stop.is_set():
            if batch := self._batch():
                await first_of(self._publish(client, batch), self._quiet())
            else:
                await self._waiting.wait()

    def _batch(self) -> list[Outgoing]:
        """Return what to send next; where there is nothing, clear `_waiting`."""
        with self._lock:
            batch = self._outbox.batch(time.monotonic())
            if not batch:
                self._waiting.clear()
            dropped = self._outbox.dropped - self._told
            self._told += dropped
        if dropped:
            address = self._broker.address
            _logger.warning("%s: messages not sent in time: %d", address, dropped)
        return batch

    async def _publish(self, client: aiomqtt.Client, batch: list[Outgoing]) -> None:
        """Publish `batch`, together: where one fails, those that arrived are sent."""
        async with asyncio.TaskGroup() as group:
            for message in batch:
                group.create_task(
                    self._publish_one(client, message), name="mqtt/publish"
                )

    async def _publish_one(self, client: aiomqtt.Client, message: Outgoing) -> None:
        """Publish `message`; it counts as sent once the broker has it."""
        topic, payload, retain = message
        await client.publish(topic, payload, qos=1, retain=retain, timeout=math.inf)
        with self._lock:
            self._outbox.sent(message)

    async def _leave(self, client: aiomqtt.Client, sending: asyncio.Task[None]) -> None:
        """Send what waits, if that is soon done, and say ``offline``.

        A broker publishes the last will only for those who left without a word.

        Args:
            client: The connection.
            sending: Its sender, which is told to end: what it has begun it finishes,
                lest that be sent twice.
        """
        try:
            async with asyncio.timeout(_DRAIN):
                await sending
                while batch := self._batch():
                    await self._publish(client, batch)
                if self._status is not None:
                    await client.publish(self._status, OFFLINE, qos=1, retain=True)
        except (TimeoutError, ExceptionGroup, aiomqtt.MqttError):
            left = len(self._outbox)
            _logger.warning("%s: left with %d unsent", self._broker.address, left)

    def _wake(self) -> None:
        """Let the sender look; the caller holds the lock."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._waiting.set)

    def _log_trouble(self, error: Exception) -> None:
        """Say once an outage what is wrong, and again when that changes."""
        text = str(explained(self._broker, error))
        if self._said == text:
            return
        self._said = text
        tries = (
            f"until the run ends, every {LONGEST:g} s at the latest"
            if self._was_connected
            else f"for {self._broker.patience:g} s in all"
        )
        told = "%s: not connected, got %s; trying again %s"
        _logger.log(self._level, told, self._broker.address, text, tries)


class _Client(aiomqtt.Client):
    """One connection."""

    def disconnect_for_good(self) -> None:
        """Disconnect, and end the session."""
        nothing = Properties(PacketTypes.DISCONNECT)
        nothing.SessionExpiryInterval = 0
        self._client.disconnect(properties=nothing)


def _trust(broker: MqttBroker) -> ssl.SSLContext | None:
    """Return whom to trust; None if the connection is not encrypted."""
    if not broker.tls:
        return None
    try:
        return ssl.create_default_context(cafile=broker.ca_file)
    except OSError as error:
        rule = f"must be PEM certificates that can be read ({error.strerror})"
        raise InvalidValueError("ca_file", rule, broker.ca_file) from error


def _handing_to(
    take: Callable[[aiomqtt.Message], None],
) -> type[asyncio.Queue[aiomqtt.Message]]:
    """Return a queue, as the library wants one, that hands over at once."""

    class Handing(asyncio.Queue[aiomqtt.Message]):
        def put_nowait(self, item: aiomqtt.Message) -> None:
            take(item)

    return Handing


async def _listen(client: aiomqtt.Client) -> None:
    """Wait until the connection breaks."""
    async for _ in client.messages:  # none is queued; this is how to hear of the end
        pass


def _close_failed_socket(error: Exception) -> None:
    """Close the socket of a failed handshake, which paho leaves to whom it may concern.

    Nothing but the frames that the error came through refers to it, and they live as
    long as the error does.
    """
    if error.__context__ is not None:
        traceback.clear_frames(error.__context__.__traceback__)


def _first(group: ExceptionGroup[Exception]) -> Exception:
    """Return the library's error in a group, or the first one if it has none."""
    ours, _ = group.split(aiomqtt.MqttError)
    error: Exception = ours or group
    while isinstance(error, ExceptionGroup):
        error = error.exceptions[0]
    return error


def delay_after(last: float, error: Exception, lasted: float) -> float:
    """Return the seconds before the next attempt, before jitter: they double.

    Args:
        last: What they were before the last one; 0: there was none.
        error: What that failed of. Asking often does not help against a refusal, and
            may lock an account.
        lasted: Seconds since it was tried. Only a connection that lasted starts over
            with the shortest delay: a broker may let in and drop at once.
    """
    if is_refusal(error):
        return LONGEST
    return SHORTEST if lasted > LONGEST else min(max(2 * last, SHORTEST), LONGEST)


def is_refusal(error: Exception) -> bool:
    """Whether the broker does not want this name with this password."""
    return _code(error) in _REFUSED


def _code(error: Exception) -> int | None:
    """Return why the broker wants no connection, as MQTT 5 numbers it."""
    # Plain numbers are the client library's own, and 5 is another thing there.
    if isinstance(error, aiomqtt.MqttCodeError) and isinstance(error.rc, ReasonCode):
        return error.rc.value
    return None


def explained(broker: MqttBroker, error: Exception) -> Exception:
    """Return what is wrong in words that name it, where trying again is no help.

    Returns:
        An `InvalidValueError` that names what the broker or we do not accept, never
        the password; `error` itself where it may be better next time.
    """
    if is_refusal(error):
        rule = f"must be taken by {broker.address}, with its password ({error})"
        return InvalidValueError("username", rule, broker.username)
    # The library keeps only the text, and Python what it was made of.
    if isinstance(error.__context__, ssl.SSLCertVerificationError):
        rule = f"must have a certificate that is trusted ({error})"
        return InvalidValueError("broker", rule, broker.address)
    return error


def give_up(broker: MqttBroker, error: Exception, *, late: bool) -> None:
    """Raise what a start fails of, if it is to fail; `late`: the patience is over.

    Raises:
        InvalidValueError: It will not be better next time.
        NeurosnapError: It may be, but it took too long.
    """
    named = explained(broker, error)
    if named is not error:
        raise named from error
    if isinstance(error, InvalidValueError):
        raise error
    if late:
        within = f"must answer within {broker.patience:g} s"
        raise NeurosnapError(
            f"broker: {within}, got nothing from {broker.address} ({error})"
        ) from error
