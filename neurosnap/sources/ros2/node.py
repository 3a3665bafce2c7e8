"""A small node of ROS 2, which publishes: no service, no action, no parameter.

Others see it and its topics, and receive its messages, as those of any node over
Zenoh. It publishes nothing while a node of Humble is in the graph: that reads another
attachment, and might end of ours.
"""

import itertools
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import zenoh
import zenoh.ext

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.sources.ros2.graph import GraphWatch
from neurosnap.sources.ros2.keys_and_tokens import (
    PUBLISHER,
    Attachment,
    Endpoint,
    GraphNode,
    Qos,
    gid_of,
)
from neurosnap.sources.ros2.message_types import stock_types

USUAL = Qos(depth=10)
"""What publishers of ROS 2 have if nothing is said."""
_HEARTBEAT = 0.5  # seconds, as others have it
_numbers = itertools.count()  # ids of nodes and endpoints, each once in a process


class RosNode:
    """A node that publishes.

    Args:
        session: From `neurosnap.sources.ros2.graph.open_session`; not closed here. Once
            its router was away it may be deaf: make both anew (`when_lost` tells).
        name: Its name, without a namespace.
        namespace: Begins with a slash.
        domain: The ROS domain.
        clock: Says the time of messages: nanoseconds since 1970.

    Attributes:
        types: Classes of messages by their types: ``types["std_msgs/msg/Bool"](True)``.

    Raises:
        InvalidValueError: The name is none.
    """

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        *,
        namespace: str = "/",
        domain: int = 0,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        if not name.isidentifier() or not name.isascii():
            rule = "must be letters, digits and underscores, a letter first"
            raise InvalidValueError("node", rule, name)
        self._session, self._clock = session, clock
        self._store = stock_types()
        self.types: dict[str, Any] = self._store.types
        zid, number = str(session.zid()), str(next(_numbers))
        self._node = GraphNode(domain, zid, number, name, namespace)
        self._open = ExitStack()
        self._watch = GraphWatch(session, domain)
        self._open.callback(self._watch.close)
        token = session.liveliness().declare_token(self._node.token)
        self._open.callback(token.undeclare)

    def publisher(self, topic: str, kind: str, qos: Qos = USUAL) -> "RosPublisher":
        """Return a publisher of a topic, which others see from now on.

        Args:
            topic: With its namespace: ``/diagnostics``.
            kind: The type of its messages, one that comes with ROS 2.
            qos: What others are told. `latched` keeps the last `depth` messages for
                those who come later.

        Raises:
            FabricError: A node of Humble is in the graph.
            InvalidValueError: There is no such type, or the topic is no name.
        """
        if not topic.startswith("/") or set(topic) & set("*$#?%") or "//" in topic:
            raise InvalidValueError("topic", "must be like /robot/diagnostics", topic)
        if kind not in self.types:
            raise InvalidValueError("type", "must come with ROS 2", kind)
        self.check()
        hashed = self._store.hash_rihs01(kind)
        number = str(next(_numbers))
        endpoint = Endpoint(self._node, number, PUBLISHER, topic, kind, hashed, qos)
        control = zenoh.CongestionControl.DROP
        if qos.reliable and qos.keep_all:
            control = zenoh.CongestionControl.BLOCK
        made: zenoh.Publisher | zenoh.ext.AdvancedPublisher
        if qos.latched:
            missed = zenoh.ext.MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=_HEARTBEAT
            )
            # A large message must not be dropped half way to one that comes later.
            block = zenoh.CongestionControl.BLOCK
            replies = zenoh.ext.RepliesConfig(congestion_control=block)
            made = zenoh.ext.declare_advanced_publisher(
                self._session,
                endpoint.key,
                congestion_control=control,
                cache=zenoh.ext.CacheConfig(qos.depth, replies_config=replies),
                publisher_detection=True,
                sample_miss_detection=missed if qos.reliable else None,
            )
        else:
            made = self._session.declare_publisher(
                endpoint.key, congestion_control=control
            )
        self._open.callback(made.undeclare)
        token = self._session.liveliness().declare_token(endpoint.token)
        self._open.callback(token.undeclare)

        def encoded(message: object) -> bytes:
            return bytes(self._store.serialize_cdr(message, kind))

        return RosPublisher(made, endpoint, encoded, self.check, self._clock)

    def check(self) -> None:
        """Check that what is published can be read by every node there is.

        Raises:
            FabricError: A node of Humble is in the graph.
        """
        with self._watch.lock:
            older = self._watch.graph.older
        if older is not None:
            rule = "must be none of Humble, whose messages have another form"
            raise FabricError(f"nodes of ROS 2: {rule}, got {older.node.path}")

    def close(self) -> None:
        """Leave the graph; may be called twice."""
        self._open.close()


class RosPublisher:
    """Publishes messages of one type to a topic; from `RosNode.publisher`."""

    def __init__(
        self,
        made: "zenoh.Publisher | zenoh.ext.AdvancedPublisher",
        endpoint: Endpoint,
        encoded: Callable[[object], bytes],
        check: Callable[[], None],
        clock: Callable[[], int],
    ) -> None:
        self._made, self._encoded, self._check = made, encoded, check
        self._clock, self._gid = clock, gid_of(endpoint.token)
        self._lock, self._count = threading.Lock(), 0

    def publish(self, message: object) -> None:
        """Publish a message; from any thread, but not in a callback of Zenoh's.

        Args:
            message: Made of `RosNode.types`.

        Raises:
            FabricError: A node of Humble is in the graph.
            InvalidValueError: It is no message of the topic's type.
        """
        self._check()
        try:
            payload = self._encoded(message)
        except Exception as error:  # of code that was made of the type
            rule = f"must be of the topic's type ({type(error).__name__}: {error})"
            raise InvalidValueError("message", rule, message) from error
        with self._lock:  # numbers go up in the order in which they are sent
            self._count += 1
            said = Attachment(self._count, self._clock(), self._gid)
            self._made.put(payload, attachment=said.data)
