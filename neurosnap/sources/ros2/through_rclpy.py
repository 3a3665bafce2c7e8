"""Hears ROS 2 through its own `rclpy`, over any middleware, as `ros2_source` does.

The graph is looked at twice a second: `rclpy` does not tell of its changes. A topic is
heard as its publishers offer it: as reliable, and what is latched too, if all of them
are. Who is killed is still in the graph for as long as the middleware believes in it,
with Fast DDS some 20 s.

Messages come as bytes, and are decoded as those over Zenoh are. `rclpy` wants the
class of a type, too: its package must be installed.
"""

import importlib
import importlib.util
import os
import time
from contextlib import ExitStack, suppress
from typing import Any, NamedTuple

from neurosnap.errors import InvalidValueError
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.ros2.graph import RosGraph
from neurosnap.sources.ros2.keys_and_tokens import PUBLISHER, Endpoint, GraphNode
from neurosnap.sources.ros2.options import Ros2Options
from neurosnap.sources.ros2.ros2_source import Ros2Feeder

_EVERY = 0.5  # seconds
_KNOWS = 2.0  # seconds after which a node knows of the others
_DEPTH = 10  # of a subscription's queue, as is usual
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


class _Offer(NamedTuple):
    """What the publishers of a topic have in common."""

    kinds: frozenset[tuple[str, str]]
    """Types, with their hashes."""
    reliability: Any
    durability: Any


class RclpyFeeder(Ros2Feeder):
    """Turns messages that `rclpy` receives into readings.

    Args:
        options: What is read.

    Raises:
        InvalidValueError: As `ros2_source`, or `rclpy` is not installed.
    """

    def __init__(self, options: Ros2Options) -> None:
        check_installed()
        super().__init__(options)
        self._offers: dict[str, tuple[_Offer, list[Any]]] = {}

    def _listen(self, source: LiveSource) -> None:
        with ExitStack() as open_:
            node, executor = _node(self._options.domain, open_)
            source.listens(True)
            due = time.monotonic()
            while not self._over:
                if (now := time.monotonic()) >= due:
                    self._look(node)
                    due = now + _EVERY
                executor.spin_once(timeout_sec=_EVERY)

    def _look(self, node: Any) -> None:  # noqa: ANN401 - untyped
        """Subscribe as the graph has it now, and forget what is published no more."""
        from rclpy.qos import QoSProfile

        for topic in self._signals:
            offer = _offered(node.get_publishers_info_by_topic(topic))
            before, subscriptions = self._offers.get(topic, (_offered([]), []))
            if offer == before:
                continue
            for each in subscriptions:
                node.destroy_subscription(each)
            profile = QoSProfile(
                depth=_DEPTH, reliability=offer.reliability, durability=offer.durability
            )
            self._offers[topic] = (
                offer,
                [
                    node.create_subscription(
                        found,
                        topic,
                        lambda data, about, topic=topic, kind=kind: self.take(
                            topic, kind, about["source_timestamp"] / 1e9, data
                        ),
                        profile,
                        raw=True,
                    )
                    for kind in offer.kinds
                    if (found := self._class(topic, kind)) is not None
                ],
            )
            if not offer.kinds:
                self._forget(topic)

    def _class(self, topic: str, kind: tuple[str, str]) -> Any:  # noqa: ANN401
        """Return the class of a type; None, and say so, if nothing is known of it.

        Nothing is imported but by the name of a type that is known here.
        """
        with self._lock:
            decoder = self._decoders[kind] = self._types.find(*kind)
        found, why = None, "no file of msg_files is of it"
        if decoder is not None:
            package, _, name = kind[0].split("/")
            why = f"its package {package} is not installed"
            with suppress(ImportError):
                found = getattr(importlib.import_module(f"{package}.msg"), name, None)
        if found is None:
            self._tell(topic, kind, why)
        return found


def _node(domain: int, open_: ExitStack) -> tuple[Any, Any]:
    """Return a node, and what lets it hear; both until `open_` is closed."""
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    # Other machines neither see the node nor are seen, unless a user says so.
    os.environ.setdefault(_RANGE, "LOCALHOST")
    context = Context()
    # No log files, and no handlers of signals: those are the run's.
    quiet = ["--ros-args", "--disable-external-lib-logs"]
    context.init(args=quiet, domain_id=domain)
    open_.callback(context.try_shutdown)
    own = {"enable_rosout": False, "start_parameter_services": False}
    node = Node("neurosnap", context=context, **own)
    open_.callback(node.destroy_node)
    executor = SingleThreadedExecutor(context=context)
    open_.callback(executor.shutdown)
    executor.add_node(node)
    return node, executor


def graph_through_rclpy(domain: int) -> RosGraph:
    """Return the nodes and publishers that a node knows of after two seconds.

    Raises:
        InvalidValueError: `rclpy` is not installed.
    """
    check_installed()
    graph, until = RosGraph(), time.monotonic() + _KNOWS
    with ExitStack() as open_:
        node, executor = _node(domain, open_)
        while time.monotonic() < until:
            executor.spin_once(timeout_sec=_EVERY)
        for name, space in node.get_node_names_and_namespaces():
            if name != node.get_name():
                graph.add(GraphNode(domain, "1", "0", name, space).token)
        for topic, _ in node.get_topic_names_and_types():
            for each in node.get_publishers_info_by_topic(topic):
                by = GraphNode(domain, "1", "0", each.node_name, each.node_namespace)
                said = topic, each.topic_type, str(each.topic_type_hash)
                graph.add(Endpoint(by, "0", PUBLISHER, *said).token)
    return graph


def check_installed() -> None:
    """Raise InvalidValueError if there is no `rclpy`."""
    if importlib.util.find_spec("rclpy") is None:
        rule = "must be installed for this Python (source the setup of ROS 2)"
        raise InvalidValueError("through", rule, "rclpy")


def _offered(publishers: list[Any]) -> _Offer:
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

    kinds = ((each.topic_type, str(each.topic_type_hash)) for each in publishers)
    reliability, durability = ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE
    every = [each.qos_profile for each in publishers]
    if any(each.reliability != reliability for each in every):
        reliability = ReliabilityPolicy.BEST_EFFORT
    if all(each.durability != durability for each in every):
        durability = DurabilityPolicy.TRANSIENT_LOCAL
    return _Offer(frozenset(kinds), reliability, durability)
