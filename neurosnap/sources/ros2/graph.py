"""The graph of ROS 2: which nodes there are, and what they publish; kept up to date.

`RosGraph` is pure: tokens in, nodes and endpoints out. `GraphWatch` feeds one from a
session. It subscribes to tokens with those there are already; to ask for them once, as
`liveliness().get` would, misses some.
"""

import logging
import threading
from collections.abc import Callable, Iterator

import zenoh

from neurosnap.errors import FabricError
from neurosnap.fabric.zenoh.connect_session import RETRY, configuration, reason_of
from neurosnap.sources.ros2.keys_and_tokens import (
    NO_HASH,
    PUBLISHER,
    SERVICE,
    TOKENS,
    Endpoint,
    GraphNode,
    parse_token,
)

MOST = 65_536
"""Tokens of a graph that are kept; more are left out, and told of once."""
_PATIENCE = 10.0  # seconds a router may take to answer
_logger = logging.getLogger(__name__)


class RosGraph:
    """Nodes and endpoints, by their tokens."""

    def __init__(self) -> None:
        self._all: dict[str, GraphNode | Endpoint] = {}
        self._refused = False

    def add(self, token: str) -> bool:
        """Take in a token; return whether it is new. One that is none is told of."""
        try:
            if token in self._all:
                return False
            if len(self._all) >= MOST:
                raise ValueError(f"must be one of at most {MOST}")  # noqa: TRY301
            self._all[token] = parse_token(token)
        except ValueError as error:
            if not self._refused:
                self._refused = True
                _logger.warning("token: %s, got %.300r: left out", error, token)
            return False
        return True

    def remove(self, token: str) -> bool:
        """Leave out a token; return whether it was there."""
        return self._all.pop(token, None) is not None

    @property
    def nodes(self) -> list[GraphNode]:
        """The nodes, in the order in which they came."""
        return [each for each in self._all.values() if isinstance(each, GraphNode)]

    def endpoints(self, kind: str = PUBLISHER) -> Iterator[Endpoint]:
        """Yield the endpoints of a kind, in the order in which they came."""
        for each in self._all.values():
            if isinstance(each, Endpoint) and each.kind == kind:
                yield each

    def publishers(self) -> dict[str, list[Endpoint]]:
        """Return the publishers of each topic."""
        topics: dict[str, list[Endpoint]] = {}
        for each in self.endpoints():
            topics.setdefault(each.name, []).append(each)
        return topics

    def service(self, node: GraphNode, name: str) -> Endpoint | None:
        """Return a service of a node, if it has that."""
        path = f"{node.path}/{name}"
        return next((one for one in self.endpoints(SERVICE) if one.name == path), None)

    @property
    def older(self) -> Endpoint | None:
        """An endpoint that speaks as Humble does; None without one."""
        of_all = self._all.values()
        older = (e for e in of_all if isinstance(e, Endpoint) and e.hash == NO_HASH)
        return next(older, None)


class GraphWatch:
    """Keeps a graph up to date, over a session; all there is when it returns is in it.

    Args:
        session: From `open_session`; not closed here.
        domain: The ROS domain.
        changed: Is called on a thread of Zenoh's after each change: it must be short.

    Attributes:
        lock: To be held while `graph` is read.
    """

    def __init__(
        self,
        session: zenoh.Session,
        domain: int = 0,
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        self.graph = RosGraph()
        self.lock = threading.Lock()
        self._changed = changed
        where, lives = f"{TOKENS}/{domain}/**", session.liveliness()
        self._listener = lives.declare_subscriber(
            where, zenoh.handlers.Callback(self._hear, indirect=False), history=True
        )
        # Answered behind what the subscriber was sent: all there was has come then.
        for _ in lives.get(where, timeout=_PATIENCE):
            pass

    def _hear(self, sample: zenoh.Sample) -> None:
        token = str(sample.key_expr)
        with self.lock:
            if sample.kind == zenoh.SampleKind.PUT:
                changed = self.graph.add(token)
            else:
                changed = self.graph.remove(token)
        if changed:
            self._changed()

    def close(self) -> None:
        """Stop listening."""
        self._listener.undeclare()


def open_session(router: str, patience: float = _PATIENCE) -> zenoh.Session:
    """Return a session with a router of ROS 2 alone: it listens to no one else.

    Args:
        router: Its endpoint, ``tcp/localhost:7447``.
        patience: Seconds it may take to answer.

    Raises:
        FabricError: It does not.
    """
    try:
        return zenoh.open(
            configuration(
                "client",
                connect__endpoints=[router],
                connect__timeout_ms=int(patience * 1000),
                connect__retry=RETRY,
                timestamping__enabled=True,  # what is latched is kept by time
            )
        )
    except zenoh.ZError as error:
        rule = f"must reach a router at {router}"
        raise FabricError(f"ros2: {rule}, got {reason_of(error)}") from error
