"""A node is seen and heard by others; nothing is published that may harm them."""

import queue
from collections.abc import Callable
from itertools import count

import pytest
import zenoh
import zenoh.ext

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.sources.ros2.graph import MOST, GraphWatch, RosGraph, open_session
from neurosnap.sources.ros2.keys_and_tokens import (
    NO_HASH,
    PUBLISHER,
    SUBSCRIPTION,
    Attachment,
    Endpoint,
    GraphNode,
    Qos,
    gid_of,
    parse_attachment,
)
from neurosnap.sources.ros2.message_types import stock_types
from neurosnap.sources.ros2.node import RosNode
from tests.support.patience import PATIENCE
from tests.support.ports import free_port

pytestmark = pytest.mark.zenoh
BOOL = "std_msgs/msg/Bool"
Connect = Callable[[], zenoh.Session]
domains = count(1)  # no test hears another's


def heard(sample: zenoh.Sample) -> tuple[bool, Attachment]:
    assert sample.attachment is not None
    message = stock_types().deserialize_cdr(sample.payload.to_bytes(), BOOL)
    return message.data, parse_attachment(sample.attachment.to_bytes())


def test_others_see_and_hear_it(connect: Connect) -> None:
    domain, clock = next(domains), count(1_000)
    said: queue.Queue[zenoh.Sample] = queue.Queue()
    other = connect()
    other.declare_subscriber(f"{domain}/door/**", said.put)
    node = RosNode(connect(), "one", domain=domain, clock=lambda: next(clock))
    door = node.publisher("/door", BOOL)
    for on in (True, False):
        door.publish(node.types[BOOL](on))
    first, second = (heard(said.get(timeout=PATIENCE)) for _ in range(2))
    watch = GraphWatch(other, domain)
    (endpoint,) = watch.graph.endpoints()
    assert (endpoint.name, endpoint.type, endpoint.qos.depth) == ("/door", BOOL, 10)
    assert [each.path for each in watch.graph.nodes] == ["/one"]
    gid = gid_of(endpoint.token)
    assert first == (True, Attachment(1, 1_000, gid))
    assert second == (False, Attachment(2, 1_001, gid))
    node.close()
    node.close()
    watch.close()


def test_what_is_latched_reaches_who_comes_later(connect: Connect) -> None:
    domain = next(domains)
    node = RosNode(connect(), "one", domain=domain)
    door = node.publisher("/door", BOOL, Qos(latched=True, depth=1))
    for on in (True, False):
        door.publish(node.types[BOOL](on))
    said: queue.Queue[zenoh.Sample] = queue.Queue()
    listener = zenoh.ext.declare_advanced_subscriber(
        connect(),
        f"{domain}/door/**",
        said.put,
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
    )
    last, attachment = heard(said.get(timeout=PATIENCE))
    assert (last, attachment.number) == (False, 2)
    listener.undeclare()
    node.close()


def test_nothing_is_published_to_a_node_of_humble(connect: Connect) -> None:
    domain = next(domains)
    other = connect()
    who = GraphNode(domain, "ab", "0", "old")
    old = Endpoint(who, "1", SUBSCRIPTION, "/x", BOOL, NO_HASH)
    token = other.liveliness().declare_token(old.token)
    node = RosNode(connect(), "one", domain=domain)
    rule = "^nodes of ROS 2: must be none of Humble, whose messages .*, got /old$"
    with pytest.raises(FabricError, match=rule):
        node.publisher("/door", BOOL)
    gone: queue.Queue[None] = queue.Queue()
    watch = GraphWatch(other, domain, changed=lambda: gone.put(None))
    token.undeclare()
    while watch.graph.older is not None:
        gone.get(timeout=PATIENCE)
    watch.close()
    node.close()


def test_a_node_of_humble_that_comes_later_ends_it(connect: Connect) -> None:
    domain, other = next(domains), connect()
    node = RosNode(connect(), "one", domain=domain)
    door = node.publisher("/door", BOOL)
    door.publish(node.types[BOOL](True))
    who = GraphNode(domain, "ab", "0", "old")
    old = Endpoint(who, "1", SUBSCRIPTION, "/x", BOOL, NO_HASH)
    token = other.liveliness().declare_token(old.token)
    with pytest.raises(FabricError, match="must be none of Humble"):
        while True:
            door.publish(node.types[BOOL](True))
    token.undeclare()
    node.close()


def test_a_wrong_name_type_or_message(connect: Connect) -> None:
    session = connect()
    with pytest.raises(InvalidValueError, match=r"^node: must be letters, digits"):
        RosNode(session, "a/b")
    node = RosNode(session, "one", domain=next(domains))
    for topic in ("door", "/a*", "//a"):
        with pytest.raises(InvalidValueError, match=r"^topic: must be like /robot"):
            node.publisher(topic, BOOL)
    with pytest.raises(InvalidValueError, match=r"^type: must come with ROS 2, got"):
        node.publisher("/door", "my_msgs/msg/Door")
    door = node.publisher("/door", BOOL)
    with pytest.raises(InvalidValueError, match=r"^message: must be of the topic's"):
        door.publish("on")
    node.close()


def test_a_router_that_is_not_there() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with pytest.raises(FabricError, match=f"^ros2: must reach a router at {endpoint}"):
        open_session(endpoint, patience=0.1)


def test_the_graph_of_tokens(caplog: pytest.LogCaptureFixture) -> None:
    graph, node = RosGraph(), GraphNode(0, "ab", "0", "one", "/arm")
    ends = [
        Endpoint(node, str(k), PUBLISHER, name, BOOL, "RIHS01_0")
        for k, name in enumerate(["/a", "/b", "/a"])
    ]
    assert graph.add(node.token)
    assert all(graph.add(each.token) for each in ends)
    assert not graph.add(node.token)
    assert graph.publishers() == {"/a": [ends[0], ends[2]], "/b": [ends[1]]}
    assert graph.remove(ends[0].token)
    assert not graph.remove(ends[0].token)
    assert graph.publishers() == {"/b": [ends[1]], "/a": [ends[2]]}
    assert graph.service(node, "get") is None
    assert not any(graph.add(f"@ros2_lv/{k}") for k in range(9))
    assert [each.message for each in caplog.records] == [
        "token: must be 9 parts or more, none of them empty, got '@ros2_lv/0': left out"
    ]


def test_a_graph_has_a_bound() -> None:
    graph = RosGraph()
    for k in range(MOST + 9):
        graph.add(GraphNode(0, "ab", str(k), "one").token)
    assert len(graph.nodes) == MOST
