"""What ROS 2 says over Zenoh (`rmw_zenoh_cpp`): keys, tokens, qualities, attachments.

Each node and each of its publishers, subscriptions, services and clients declares a
liveliness token. It says all that others know of it:

    @ros2_lv/DOMAIN/ZID/NODE ID/ID/KIND/ENCLAVE/NAMESPACE/NODE[/NAME/TYPE/HASH/QOS]

A name has ``%`` for each ``/``, and is ``%`` if it is empty. A message is put to
``DOMAIN/NAME/TYPE/HASH``, with an attachment of 33 bytes: its number, its time, and a
hash of its publisher's token. A subscription in another process may end of one that it
cannot read, so nothing is put without a right one.

All of this is pure. Humble has no hashes of types, and the first releases for Jazzy had
another attachment: these are read, and never written.
"""

import struct
from typing import NamedTuple

from neurosnap.errors import MissingExtraError
from neurosnap.system.distribution import must_have

TOKENS = "@ros2_lv"
"""What all tokens begin with; no wildcard matches it."""
NODE, PUBLISHER, SUBSCRIPTION, SERVICE, CLIENT = "NN", "MP", "MS", "SS", "SC"
NO_HASH = "TypeHashNotSupported"
"""What Humble says for the hash of every type."""
_KINDS = frozenset((PUBLISHER, SUBSCRIPTION, SERVICE, CLIENT))
_NODE_PARTS, _PARTS = 9, 13
_DEPTH = 42  # of a queue about which nothing is said
_STAMP = struct.Struct("<qqB16s")
_OLDER = struct.Struct("<16sq17sq11sB16s")
_NAMES = b"\x0fsequence_number", b"\x10source_timestamp", b"\x0asource_gid"


class Qos(NamedTuple):
    """The qualities of an endpoint that matter to who listens."""

    reliable: bool = True
    latched: bool = False
    """Those who come later get the last messages, too (transient local)."""
    keep_all: bool = False
    depth: int = _DEPTH

    @property
    def text(self) -> str:
        """It as part of a token: what is as usual is empty."""
        reliability = "" if self.reliable else "2"
        durability = "1" if self.latched else ""
        history = "2" if self.keep_all else ""
        depth = "" if self.depth == _DEPTH else str(self.depth)
        return f"{reliability}:{durability}:{history},{depth}:,:,:,,"


class GraphNode(NamedTuple):
    """A node, as its token tells of it."""

    domain: int
    session: str
    """The id of its Zenoh session: hexadecimal, without zeros in front."""
    id: str
    name: str
    namespace: str = "/"
    enclave: str = ""

    @property
    def path(self) -> str:
        """Its name in its namespace, as `ros2 node list` has it."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    @property
    def token(self) -> str:
        """Its token."""
        return self.token_of(self.id, NODE)

    def token_of(self, number: str, kind: str) -> str:
        """Return the beginning of the token of one of its endpoints."""
        where = f"{TOKENS}/{self.domain}/{self.session}/{self.id}/{number}/{kind}"
        names = self.enclave, self.namespace, self.name
        return "/".join((where, *map(mangled, names)))


class Endpoint(NamedTuple):
    """A publisher, a subscription, a service or a client of a node."""

    node: GraphNode
    id: str
    kind: str
    name: str
    """Of the topic or service: ``/battery_state``."""
    type: str
    """``sensor_msgs/msg/BatteryState``."""
    hash: str
    """``RIHS01_...``, or `NO_HASH`."""
    qos: Qos = Qos()

    @property
    def token(self) -> str:
        """Its token."""
        parts = self.name, dds_type(self.type), self.hash
        begin = self.node.token_of(self.id, self.kind)
        return "/".join((begin, *map(mangled, parts), self.qos.text))

    @property
    def key(self) -> str:
        """What its messages are put to."""
        name = self.name.strip("/")
        return f"{self.node.domain}/{name}/{dds_type(self.type)}/{self.hash}"


class Attachment(NamedTuple):
    """What comes with every message."""

    number: int
    """From 1 on, for each publisher."""
    at: int
    """When it was sent: nanoseconds since 1970, by the sender's clock."""
    gid: bytes
    """The publisher's: `gid_of` its token."""
    older: bool = False
    """It has the form of the first releases for Jazzy."""

    @property
    def data(self) -> bytes:
        """It as bytes, in the present form."""
        return _STAMP.pack(self.number, self.at, len(self.gid), self.gid)


def mangled(name: str) -> str:
    """Return a name as a part of a token.

    Examples:
        >>> mangled("/robot/scan"), mangled("/"), mangled("")
        ('%robot%scan', '%', '%')
    """
    return name.replace("/", "%") or "%"


def dds_type(name: str) -> str:
    """Return a type as it stands in keys.

    Examples:
        >>> dds_type("std_msgs/msg/String")
        'std_msgs::msg::dds_::String_'
    """
    *package, last = name.split("/")
    return "::".join((*package, "dds_", f"{last}_"))


def ros_type(name: str) -> str:
    """Return a type as it is written, given as it stands in keys.

    Examples:
        >>> ros_type("std_msgs::msg::dds_::String_")
        'std_msgs/msg/String'
    """
    return name.replace("::dds_::", "/").replace("::", "/").removesuffix("_")


def gid_of(token: str) -> bytes:
    """Return the 16 bytes by which messages name who sent them.

    Raises:
        MissingExtraError: `xxhash` is not installed.
    """
    try:
        import xxhash
    except ImportError as error:
        raise MissingExtraError(f"ros2: {must_have('xxhash', 'ros2')}") from error
    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")


def parse_token(token: str) -> GraphNode | Endpoint:
    """Return the node or the endpoint that a token tells of.

    Further parts, as the newest release adds for some types, are passed over.

    Raises:
        ValueError: It is no such token; the text is the rule.
    """
    parts = token.split("/")
    if len(parts) < _NODE_PARTS or parts[0] != TOKENS or not all(parts):
        raise ValueError(f"must be {_NODE_PARTS} parts or more, none of them empty")
    _, domain, session, node_id, number, kind, enclave, namespace, name = parts[:9]
    if not domain.isdecimal():
        raise ValueError("must have a number as its domain")
    node = GraphNode(
        int(domain),
        session,
        node_id,
        _plain(name),
        _plain(namespace),
        "" if enclave == "%" else _plain(enclave),
    )
    if kind == NODE:
        return node
    if kind not in _KINDS or len(parts) < _PARTS:
        raise ValueError(f"must be a node, or an endpoint with {_PARTS} parts")
    name, dds, hashed, qos = parts[9:13]
    said = _plain(name), ros_type(dds), hashed, _qos(qos)
    return Endpoint(node, number, kind, *said)


def _plain(name: str) -> str:
    return name.replace("%", "/")


def _qos(text: str) -> Qos:
    """Return the qualities in a token.

    Raises:
        ValueError: They are none.
    """
    try:
        reliability, durability, history, *_ = text.split(":")
        kind, depth = history.split(",")
        return Qos(
            reliability != "2",
            durability == "1",
            kind == "2",
            int(depth) if depth else _DEPTH,
        )
    except ValueError:
        raise ValueError('must have qualities as "::,10:,:,:,,"') from None


def parse_attachment(data: bytes) -> Attachment:
    """Return what came with a message, in either form.

    Raises:
        ValueError: It is none; the text is the rule.
    """
    if len(data) == _STAMP.size:
        number, at, size, gid = _STAMP.unpack(data)
        if size == len(gid):
            return Attachment(number, at, gid)
    elif len(data) == _OLDER.size:
        first, number, second, at, third, size, gid = _OLDER.unpack(data)
        if (first, second, third) == _NAMES and size == len(gid):
            return Attachment(number, at, gid, older=True)
    rule = "must come with number, time and sender in 33 bytes"
    raise ValueError(f"{rule} (it has {len(data)})")
