"""Fields of messages of ROS 2 as sensors, live.

Only the topics of sensors are subscribed to. A message is decoded by the type that its
key names; a type that nothing tells of is an error of its topic, told once. Readings
have the times that their publishers say. A topic that nothing publishes any more is
unknown, and so is everything while the router is away.

Messages are decoded where Zenoh hands them over, one after the other: a node that
publishes more than can be read is held back, and drops its own.
"""

import logging
import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import NamedTuple

import msgspec
import numpy as np
import zenoh
import zenoh.ext

from neurosnap.errors import FabricError
from neurosnap.fabric.zenoh.connect_session import when_lost
from neurosnap.sources.live.first_stretch import Ranges, listen
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.signal_readers import SignalReaders, signals_of
from neurosnap.sources.message_fields import Term, field, fields, parse_term
from neurosnap.sources.ros2.diagnostics import ARRAY
from neurosnap.sources.ros2.graph import GraphWatch, open_session
from neurosnap.sources.ros2.keys_and_tokens import (
    CLIENT,
    Attachment,
    Endpoint,
    gid_of,
    parse_attachment,
    ros_type,
)
from neurosnap.sources.ros2.message_types import LARGEST, Decoder, TypesByHash, question
from neurosnap.sources.ros2.options import Ros2Options, signal_of, topic_of
from neurosnap.sources.wanted import Wanted

_AGAIN = 1.0  # seconds until what is latched is asked for again
_ASKS = 5  # times that it is
_LATCHED = 90.0  # seconds that it may take to come
_TRY = 2.0  # seconds a router, or a node that is asked, may take to answer
_DESCRIBES = "get_type_description"
_logger = logging.getLogger(__name__)


def ros2_source(
    options: Ros2Options, *, journal: Journal | None = None, most: int | None = None
) -> LiveSource:
    """Return the source that `options` describe; it connects with its first tick.

    Args:
        options: What is read.
        journal: As for `LiveSource`.
        most: As for `LiveSource`.

    Raises:
        InvalidValueError: A file of a type cannot be read.
    """
    readers = SignalReaders(signals_of(options.sensors))
    latest = LatestReadings(
        readers.sensors,
        stale_after=options.stale_after,
        heard_within=readers.heard_within,
    )
    ticks, feeder = options.tick.schedule(), _feeder(options)
    source = LiveSource(latest, ticks, feeder=feeder, journal=journal, most=most)
    source.readers, source.numbers = readers, readers.numbers
    return source


def cut(options: Ros2Options) -> Ros2Options:
    """Return options whose numbers and words are cut into sensors.

    The graph is listened to first, for as long as `stretch` says, or until all that is
    asked for is a boolean.

    Raises:
        NeurosnapError: The router cannot be reached, or nothing fit for a sensor came.
    """
    ranges = Ranges(Wanted(patterns=options.plain, bins=options.bins))
    listen(_feeder(options), ranges, options.stretch)
    found: dict[str, list[str]] = {}
    for name, some in ranges.chosen().items():
        texts = [f"{name} {each.text}" if each else name for each in some]
        found.setdefault(name, []).extend(texts)
        found.setdefault(topic_of(name), []).extend(texts)
    sensors: list[str] = []
    for text in options.sensors:
        heard = text not in options.plain or text in found
        if not heard:
            _logger.warning("%s: said nothing meanwhile: taken as on and off", text)
        sensors += found.get(text, [text])
    return msgspec.structs.replace(options, sensors=tuple(sensors), bins=0)


def _feeder(options: Ros2Options) -> "Ros2Feeder":
    if options.through == "zenoh":
        return Ros2Feeder(options)
    from neurosnap.sources.ros2.through_rclpy import RclpyFeeder  # which is a feeder

    return RclpyFeeder(options)


class _Wanted(NamedTuple):
    """A signal that is wanted, and where it is in a message of its topic."""

    name: str
    path: str
    term: Term | None


class _Subscription(NamedTuple):
    """A subscription to a topic."""

    close: Callable[[], None]
    depth: int
    """Messages that were published before and are asked for; 0: none is latched."""
    publishers: frozenset[str]
    """The tokens of those that were there then."""
    asks: int = _ASKS
    """How often it asks again, a second each, while nothing has come."""


class Ros2Feeder:
    """Turns messages of ROS 2 into readings.

    Args:
        options: What is read.

    Raises:
        InvalidValueError: As `ros2_source`.
    """

    def __init__(self, options: Ros2Options) -> None:
        self._options = options
        self._signals: dict[str, list[_Wanted]] = {
            topic_of(signal_of(sensor)): [] for sensor in options.sensors
        }
        self._doubted = set(options.plain)  # they may be something else than booleans
        self._types = TypesByHash(options.msg_files)
        self._decoders: dict[tuple[str, str], Decoder | None] = {}
        self._lock = threading.Lock()  # one message after the other
        self._came: set[str] = set()  # topics heard since they were subscribed to
        self._at: dict[str, float] = {}  # of each topic's last message
        self._listeners: dict[str, _Subscription] = {}
        self._told: set[str] = set()  # errors that are not told again
        self._asked: set[str] = set()  # publishers whose node was asked
        self._woken, self._over, self._gone = threading.Event(), False, False
        self._source: LiveSource | None = None
        self._thread: threading.Thread | None = None
        self._count = 0

    def start(self, source: LiveSource) -> None:
        """Begin to connect; what fails of it, the source is told."""
        self._source = source
        for name in source.readers.signals:
            topic, term = topic_of(name), parse_term(name)
            path = (term.path if term else name).removeprefix(topic)
            self._signals[topic].append(_Wanted(name, path, term))
        source.listens(False)
        self._thread = threading.Thread(
            target=self._run, args=(source,), name="ros2", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Disconnect; may wait two seconds for a router that does not answer."""
        self._over = True
        self._woken.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self, source: LiveSource) -> None:
        try:
            self._listen(source)
        except BaseException as error:  # noqa: BLE001 - goes on to `step`, whole
            source.fail(error)

    def _listen(self, source: LiveSource) -> None:
        """Listen until it is stopped; a router that comes back gets a new session."""
        patience = math.inf if source.resumed else self._options.patience
        while (session := self._connected(patience)) is not None:
            patience = math.inf  # it was reached: it is waited for
            with ExitStack() as open_:
                open_.callback(session.close)
                self._listen_to(session, source, open_)

    def _listen_to(
        self, session: zenoh.Session, source: LiveSource, open_: ExitStack
    ) -> None:
        """Listen until the router goes, or until it is stopped."""
        self._gone = False
        open_.callback(when_lost(session, self._lose))
        watch = GraphWatch(session, self._options.domain, self._woken.set)
        open_.callback(watch.close)
        open_.callback(self._unsubscribe)
        self._follow(session, watch)  # before it counts as listening
        source.listens(True)
        if self._gone:  # meanwhile: that is an outage by now
            source.listens(False)
        while not (self._over or self._gone):
            if not self._woken.wait(_AGAIN if self._lost() else None):
                self._ask_again(session, self._lost())
            self._woken.clear()
            self._follow(session, watch)

    def _connected(self, patience: float) -> zenoh.Session | None:
        """Return a session once the router answers; None if it was stopped before.

        Raises:
            FabricError: It takes longer than `patience`, in seconds.
        """
        until = time.monotonic() + patience
        while not self._over:
            try:
                return open_session(self._options.router, _TRY)
            except FabricError as error:
                if time.monotonic() > until:
                    raise
                if "" not in self._told:
                    self._told.add("")
                    _logger.warning("%s; it goes on trying", error)
        return None

    def _lose(self) -> None:
        """Note that the router is away."""
        self._gone = True
        if self._source is not None:
            self._source.listens(False)
        self._woken.set()

    def _follow(self, session: zenoh.Session, watch: GraphWatch) -> None:
        """Subscribe as the graph has it now, and forget what is published no more."""
        with watch.lock:
            publishers = watch.graph.publishers()
        for topic in self._signals:
            here = publishers.get(topic, [])
            for each in here:
                self._learn(session, watch, each)
            latched = [each.qos.depth for each in here if each.qos.latched]
            tokens = frozenset(each.token for each in here)
            before = self._listeners.get(topic)
            if before is None:
                key = f"{self._options.domain}{topic}/*/*"
                hear = zenoh.handlers.Callback(self._hear, indirect=False)
                close = session.declare_subscriber(key, hear).undeclare
                before = _Subscription(close, 0, frozenset())
            if before.publishers and not here:
                self._forget(topic)
            now = before._replace(depth=max(latched, default=0), publishers=tokens)
            self._listeners[topic] = now
            if not tokens <= before.publishers:
                self._listeners[topic] = now._replace(asks=_ASKS)
                self._came.discard(topic)
                self._ask_for_latched(session, topic)

    def _ask_for_latched(self, session: zenoh.Session, topic: str) -> None:
        """Ask all publishers of a topic for what is latched, and do not wait.

        An advanced subscriber would ask twice. While the second copy of megabytes is on
        its way to a session that was closed, a router keeps all else of the publisher.
        """
        if depth := self._listeners[topic].depth:
            session.get(
                f"{self._options.domain}{topic}/*/*/@adv/**?_max={depth}",
                zenoh.handlers.Callback(self._hear, indirect=False),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                accept_replies=zenoh.ReplyKeyExpr.ANY,
                timeout=_LATCHED,
            )

    def _lost(self) -> list[str]:
        """Return the topics of which something is latched and nothing has come.

        Who comes back with a router may be asked before it can answer.
        """
        return [
            topic
            for topic, each in self._listeners.items()
            if each.depth and each.asks and topic not in self._came
        ]

    def _ask_again(self, session: zenoh.Session, topics: list[str]) -> None:
        for topic in topics:
            before = self._listeners[topic]
            self._listeners[topic] = before._replace(asks=before.asks - 1)
            self._ask_for_latched(session, topic)

    def _unsubscribe(self) -> None:
        """Listen to no topic any more; all are unknown then."""
        for topic, each in self._listeners.items():
            each.close()
            if each.publishers:
                self._forget(topic)
        self._listeners.clear()

    def _forget(self, topic: str) -> None:
        """Let a topic be unknown: nothing publishes it any more."""
        with self._lock:
            at = self._at.get(topic)  # a publisher that comes back is not late
            gone = {each.name: None for each in self._signals[topic] if each.path}
            if self._source is not None and gone:
                readings, _ = self._source.readers.read(gone)
                self._source.forget(readings, at)

    def _learn(
        self, session: zenoh.Session, watch: GraphWatch, publisher: Endpoint
    ) -> None:
        """Find out what decodes a publisher's messages; if nothing does, tell so."""
        kind, token = (publisher.type, publisher.hash), publisher.token
        if self._decoders.get(kind) is not None or token in self._asked:
            return
        decoder = self._types.find(*kind)
        why = "its node describes no types, and no file of msg_files is of it"
        if decoder is None:
            self._asked.add(token)
            with watch.lock:
                service = watch.graph.service(publisher.node, _DESCRIBES)
            try:
                if service is not None:
                    answer = self._ask(session, service, question(*kind))
                    decoder = self._types.described(*kind, answer)
            except ValueError as error:
                why = str(error)
        self._decoders[kind] = decoder
        if decoder is None:
            self._tell(publisher.name, kind, why)

    def _tell(self, topic: str, kind: tuple[str, str], why: str) -> None:
        """Say once that nothing decodes a topic's messages of a type."""
        said = (
            f"{topic}: must be of a type that is known ({why}), got {', '.join(kind)}"
        )
        if said not in self._told:
            self._told.add(said)
            _logger.warning("%s: left out", said)

    def _ask(self, session: zenoh.Session, service: Endpoint, asked: bytes) -> bytes:
        """Return what a service answers.

        Raises:
            ValueError: It does not.
        """
        self._count += 1
        ours = service._replace(id=str(self._count), kind=CLIENT)
        ours = ours._replace(node=ours.node._replace(session=str(session.zid())))
        attachment = Attachment(self._count, time.time_ns(), gid_of(ours.token)).data
        replies = session.get(
            service.key,
            payload=asked,
            attachment=attachment,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            timeout=_TRY,
        )
        for reply in replies:
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        raise ValueError(f"{service.name} must answer within {_TRY:g} s")

    def _hear(self, said: zenoh.Sample | zenoh.Reply) -> None:
        """Hand in what a message says; on a thread of Zenoh's."""
        sample = said.ok if isinstance(said, zenoh.Reply) else said
        if not sample or not self._source or sample.kind != zenoh.SampleKind.PUT:
            return
        _, *names, dds, hashed = str(sample.key_expr).split("/")
        topic, kind = f"/{'/'.join(names)}", (ros_type(dds), hashed)
        try:
            about = sample.attachment
            at = parse_attachment(about.to_bytes() if about else b"").at / 1e9
        except ValueError as error:
            self._source.refuse(f"{topic}: {error}")
        else:
            self.take(topic, kind, at, sample.payload)

    def take(
        self,
        topic: str,
        kind: tuple[str, str],
        at: float,
        payload: zenoh.ZBytes | bytes,
    ) -> None:
        """Hand in what a message says.

        Args:
            topic: Its topic, one that is wanted.
            kind: Its type, and the hash of that.
            at: When it was sent: seconds since 1970.
            payload: Turns into its bytes.
        """
        if self._source is None:
            return
        try:
            with self._lock:
                message = None
                wanted = self._signals[topic]
                if not wanted or any(each.path for each in wanted):
                    if kind not in self._decoders:
                        self._decoders[kind] = self._types.find(*kind)
                        self._woken.set()
                    if (decoder := self._decoders[kind]) is None:
                        return  # it was told, or is about to be
                    message = _decoded(decoder, payload)
                self._at[topic] = at
                self._came.add(topic)
                values = self.values(topic, message, several=kind[0] == ARRAY)
                readings, wrong = self._source.readers.read(values, topic)
                self._source.receive(readings, at, list(map(str, wrong)))
                if not self._source.readers.signals:
                    bits = (name for name, said in values.items() if type(said) is bool)
                    self._doubted.difference_update(bits)
                    if not self._doubted:
                        self._source.end()
        except ValueError as error:
            self._source.refuse(f"{topic}: {error}")

    def values(
        self, topic: str, message: object, *, several: bool = False
    ) -> dict[str, object]:
        """Return what the signals of a topic say in a message.

        Args:
            topic: Its name.
            message: As it was decoded.
            several: What it lacks may be in the next, of another publisher.
        """
        if self._source is not None and not self._source.readers.signals:
            return dict(fields(topic, message, self._source.readers.terms(topic)))
        found: dict[str, object] = {}
        for name, path, term in self._signals[topic]:
            try:
                value = term.of(topic, message) if term else _one(message, path)
            except ValueError as error:
                if several:
                    continue
                value = None
                if name not in self._told:
                    self._told.add(name)
                    _logger.warning("%s: %s: it is unknown", name, error)
            found[name] = value
        return found


def _decoded(decoder: Decoder, payload: zenoh.ZBytes | bytes) -> object:
    """Return a message.

    Raises:
        ValueError: It is too large, or none of its type.
    """
    if len(payload) > LARGEST:
        raise ValueError(f"must be up to {LARGEST} bytes, got {len(payload)}")
    return decoder(bytes(payload))


def _one(message: object, path: str) -> object:
    """Return what a message says at a path; True if it is enough that it came.

    Raises:
        ValueError: Nothing is there, or more than one value.
    """
    if not path:
        return True
    value = field(message, path)
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict | list | np.ndarray):
        raise ValueError(f"must be one value (a field of it, or min({path}[0:9]))")  # noqa: TRY004
    return value
