"""A program for a Python that has ROS 2: what its own messages are, and what ours are.

It is run by a file's name: importing a wheel of ROS 2 starts Python anew. It takes
nothing from neurosnap, and knows of its types only what ROS 2 says.
"""

import array
import base64
import itertools
import json
import math
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

_MANY = re.compile(
    r"sequence<(?P<of>.+?)(, (?P<most>\d+))?>|(?P<item>.+)\[(?P<n>\d+)\]"
)
_FLOATS = itertools.cycle((0.5, math.nan, math.inf, -2.25, -math.inf))
_SIZES = itertools.cycle((2, 3, 0, 1))
_WORDS = itertools.cycle(("Tür", "", "ab", "a long name of a thing"))
_COUNT = itertools.count(1)


def types() -> Iterator[tuple[str, dict[str, str]]]:
    """Yield all types of messages there are, with the hashes that come with each."""
    for path in sorted(Path(sys.prefix, "share").glob("*/msg/*.json")):
        hashes = json.loads(path.read_text())["type_hashes"]
        name = f"{path.parts[-3]}/msg/{path.stem}"
        yield name, {each["type_name"]: each["hash_string"] for each in hashes}


def kind(name: str) -> Any:
    package, *_, last = name.split("/")
    return getattr(import_module(f"{package}.msg"), last)


def value(what: str) -> Any:
    """Return some value of a type of field; what comes next is another."""
    if many := _MANY.fullmatch(what):
        size = many["n"] or min(next(_SIZES), int(many["most"] or 9))
        return [value(many["of"] or many["item"]) for _ in range(int(size))]
    number = next(_COUNT)
    if "/" in what:
        made = kind(what)()
        for name, of in made.get_fields_and_field_types().items():
            setattr(made, name, value(of))
        return made
    if what.startswith(("string", "wstring")):
        return next(_WORDS)[: int((re.findall(r"\d+", what) or [99])[0])]
    if what in ("float", "double"):
        return next(_FLOATS)
    if what == "boolean":
        return number % 3 != 0
    if what == "octet":
        return bytes([-number % 256])
    signed, bits = what[0] == "i", int(what.strip("uint"))
    largest = 2 ** (bits - signed) - 1
    return (largest, number % 100, -largest - 1 if signed else 0)[number % 3]


def plain(said: Any) -> Any:
    """Return a message as JSON has it."""
    if hasattr(said, "get_fields_and_field_types"):
        names = said.get_fields_and_field_types()
        return {name: plain(getattr(said, name)) for name in names}
    if isinstance(said, (list, array.array, np.ndarray)):
        return [plain(each) for each in said]
    if isinstance(said, bytes):
        return said[0]
    return said.item() if isinstance(said, np.generic) else said


def publish(topic: str) -> None:
    """Publish on a topic what stands in each line, true or false, latched."""
    rclpy.init()
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    bool_ = kind("std_msgs/msg/Bool")
    node = rclpy.create_node(topic.strip("/"))
    publisher = node.create_publisher(bool_, topic, latched)
    for line in sys.stdin:
        publisher.publish(bool_(data=json.loads(line)))
    node.destroy_node()
    rclpy.shutdown()


def main() -> None:
    """Say what there is, or what it is that another has encoded; or publish."""
    if topic := sys.argv[1:]:
        publish(*topic)
        return
    read = json.loads(sys.stdin.read())
    if read:
        said = [
            plain(deserialize_message(base64.b64decode(data), kind(name)))
            for name, data in read
        ]
        sys.stdout.write(json.dumps(said))
        return
    for name, hashes in types():
        for _ in range(3):
            made = value(name)
            data = base64.b64encode(serialize_message(made)).decode()
            line = json.dumps([name, hashes, data, plain(made)])
            sys.stdout.write(f"{line}\n")


main()
