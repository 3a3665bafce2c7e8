"""Keys, tokens and attachments are those of rmw_zenoh's own description."""

import struct

import pytest
import zenoh.ext

from neurosnap.sources.ros2.keys_and_tokens import (
    NO_HASH,
    PUBLISHER,
    SERVICE,
    Attachment,
    Endpoint,
    GraphNode,
    Qos,
    dds_type,
    gid_of,
    mangled,
    parse_attachment,
    parse_token,
    ros_type,
)
from neurosnap.sources.ros2.message_types import stock_types

# Those of its docs/design.md.
STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
LISTENER = "@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
TALKER = (
    "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
    f"std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,"
)
KEY = f"0/chatter/std_msgs::msg::dds_::String_/{STRING}"


def test_a_node_and_a_publisher() -> None:
    node = parse_token(LISTENER)
    assert node == GraphNode(0, "aac3178e146ba6f1fc6e6a4085e77f21", "0", "listener")
    assert (node.token, node.path) == (LISTENER, "/listener")
    talker = parse_token(TALKER)
    assert isinstance(talker, Endpoint)
    assert talker.token == TALKER
    assert talker.key == KEY
    assert talker.node.name == "talker"
    assert talker[1:] == (
        *("10", PUBLISHER, "/chatter", "std_msgs/msg/String", STRING),
        Qos(depth=7),
    )
    assert parse_token(f"{TALKER}/cuda") == talker  # the newest release says more


def test_a_service_in_a_namespace() -> None:
    node = GraphNode(2, "ab", "3", "adder", "/robot/arm", "/secret")
    kind = "example_interfaces/srv/AddTwoInts"
    adder = Endpoint(node, "4", SERVICE, "/robot/arm/add", kind, NO_HASH)
    assert adder.token == (
        "@ros2_lv/2/ab/3/4/SS/%secret/%robot%arm/adder/%robot%arm%add/"
        "example_interfaces::srv::dds_::AddTwoInts_/TypeHashNotSupported/::,:,:,:,,"
    )
    assert parse_token(adder.token) == adder
    assert adder.key == (
        "2/robot/arm/add/example_interfaces::srv::dds_::AddTwoInts_/"
        "TypeHashNotSupported"
    )
    assert node.path == "/robot/arm/adder"


@pytest.mark.parametrize(
    ("qos", "text"),
    [
        (Qos(), "::,:,:,:,,"),
        (Qos(depth=10), "::,10:,:,:,,"),
        (Qos(reliable=False, depth=10), "2::,10:,:,:,,"),
        (Qos(latched=True, depth=1), ":1:,1:,:,:,,"),
        (Qos(keep_all=True), "::2,:,:,:,,"),
    ],
)
def test_qualities(qos: Qos, text: str) -> None:
    assert qos.text == text
    told = parse_token(TALKER.replace("::,7:,:,:,,", text))
    assert isinstance(told, Endpoint)
    assert told.qos == qos


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ("@ros2_lv/0/ab/0/0/NN/%/%", "must be 9 parts or more"),
        ("@ros2_lv/0/ab/0/0/NN/%//x", "must be 9 parts or more"),
        (LISTENER.replace("_lv", ""), "must be 9 parts or more"),
        (LISTENER.replace("/0/a", "/x/a"), "must have a number as its domain"),
        (LISTENER.replace("NN", "MP"), "must be a node, or an endpoint with 13"),
        (TALKER.replace("MP", "XX"), "must be a node, or an endpoint with 13"),
        (TALKER.replace("::,7:,", "::7:,"), "must have qualities as"),
        (TALKER.replace(",7:", ",x:"), "must have qualities as"),
    ],
)
def test_what_is_no_token(wrong: str, rule: str) -> None:
    with pytest.raises(ValueError, match=f"^{rule}"):
        parse_token(wrong)


def test_names_and_types() -> None:
    assert mangled("/a/b") == "%a%b"
    for name in ("std_msgs/msg/String", "nav2_msgs/action/X_Feedback", "a_/msg/B"):
        assert ros_type(dds_type(name)) == name
    assert stock_types().hash_rihs01("std_msgs/msg/String") == STRING


def test_the_hash_of_a_token() -> None:
    # XXH3-128 of nothing is 99aa06d3014798d86001c324468d497f; low half first.
    halves = bytes.fromhex("6001c324468d497f"), bytes.fromhex("99aa06d3014798d8")
    assert gid_of("") == halves[0][::-1] + halves[1][::-1]
    assert len(gid_of(TALKER)) == 16


def test_an_attachment_of_33_bytes() -> None:
    said = Attachment(1, 1_700_000_000_000_000_005, gid_of(TALKER))
    assert said.data == struct.pack("<qqB", 1, said.at, 16) + said.gid
    assert len(said.data) == 33
    assert parse_attachment(said.data) == said
    # As Zenoh's own serializer has it, which the nodes use.
    numbers = (zenoh.ext.Int64(1), zenoh.ext.Int64(said.at), said.gid)
    assert b"".join(zenoh.ext.z_serialize(n).to_bytes() for n in numbers) == said.data


def test_the_older_attachment_is_read() -> None:
    gid = bytes(range(16))
    parts = (
        *("sequence_number", zenoh.ext.Int64(3)),
        *("source_timestamp", zenoh.ext.Int64(5)),
        *("source_gid", gid),
    )
    older = b"".join(zenoh.ext.z_serialize(part).to_bytes() for part in parts)
    assert parse_attachment(older) == Attachment(3, 5, gid, older=True)
    with pytest.raises(ValueError, match=r"^must come with .* in 33 bytes \(it has 77"):
        parse_attachment(older.replace(b"gid", b"gud"))


@pytest.mark.parametrize("wrong", [b"", bytes(33), bytes(32), bytes(34)])
def test_what_is_no_attachment(wrong: bytes) -> None:
    with pytest.raises(ValueError, match=f"33 bytes .it has {len(wrong)}.$"):
        parse_attachment(wrong)
