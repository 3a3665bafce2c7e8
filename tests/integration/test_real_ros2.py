"""Real ROS 2 (rclpy of Kilted, over Fast DDS) and what is made here without it.

Its wheels stand in an environment of their own, which `make build/ros2/installed`
makes: to import one starts Python anew.
"""

import base64
import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from neurosnap.sources.ros2.diagnostics import ARRAY, STALE, Diagnostics
from neurosnap.sources.ros2.message_types import TypesByHash, stock_types
from tests.support.patience import PATIENCE

ROOT = Path(__file__).parents[2]
THERE = ROOT / "build" / "ros2"
PYTHON = THERE / "bin" / "python"
PROGRAM = ROOT / "tests" / "support" / "real_ros2.py"
pytestmark = [
    pytest.mark.exhaustive,
    pytest.mark.slow,
    pytest.mark.skipif(
        not (THERE / "installed").exists(), reason="needs make build/ros2/installed"
    ),
]
MOMENTS = "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"
KEYED = {
    "diagnostic_msgs/msg/DiagnosticStatus": "name",
    "diagnostic_msgs/msg/KeyValue": "key",
}


def asked(question: Any) -> list[Any]:
    """Return what the program says, a line of JSON each."""
    done = subprocess.run(
        (PYTHON, PROGRAM),
        input=json.dumps(question),
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def messages() -> list[tuple[str, dict[str, str], bytes, Any]]:
    """Some messages of each type: the type, hashes, CDR, and what it says."""
    said = asked(None)
    return [(name, of, base64.b64decode(data), what) for name, of, data, what in said]


def as_we_say(name: str, said: Any) -> Any:
    """Return a message as our decoder has it: no times, statuses by their names."""
    _, members = stock_types().fielddefs[name]
    kinds, found = {member: _inner(what) for member, (_, what) in members}, {}
    for member, value in said.items():
        of, many = kinds[member]
        if of in MOMENTS:
            continue
        if of in stock_types().types:
            value = [as_we_say(of, each) for each in (value if many else [value])]
            if not many:
                (value,) = value
            elif value and (key := KEYED.get(of)):
                value = {each.pop(key): each for each in value}
                if key == "key":
                    value = {k: rest["value"] for k, rest in value.items()}
        found[member] = value
    return found


def _inner(what: Any) -> tuple[str, bool]:
    """Return the type within a description of a field, and whether there are many."""
    if isinstance(what, str):
        return what, False
    first, _ = what
    return (first[1], True) if isinstance(first, tuple) else (first, False)


def same(one: Any, other: Any) -> bool:
    """Compare as text, in which NaN equals itself."""
    one, other = (json.dumps(each, default=np.ndarray.tolist) for each in (one, other))
    return bool(one == other)


def test_the_types_have_the_hashes_of_ours(messages: Any) -> None:
    hashes = {name: each for _, of, *_ in messages for name, each in of.items()}
    assert len(hashes) > 120
    ours = {name: stock_types().hash_rihs01(name) for name in hashes}
    assert ours == hashes


def test_its_messages_say_the_same_to_us(messages: Any) -> None:
    types = TypesByHash()
    for name, hashes, data, said in messages:
        decoder = types.find(name, hashes[name])
        assert decoder is not None, name
        assert same(decoder(data), as_we_say(name, said)), name


def test_what_we_encode_says_the_same_to_it(messages: Any) -> None:
    store, ours = stock_types(), []
    for name, _, data, _ in messages:
        one = store.get_msgdef(name)
        message, _ = one.deserialize_cdr_le(data[4:], 0, one.cls, store)
        again = store.serialize_cdr(message, name)
        ours.append((name, base64.b64encode(again).decode()))
    (heard,) = asked(ours)
    for (name, *_, said), there in zip(messages, heard, strict=True):
        assert same(there, said), name


def test_our_diagnostics_are_ones_to_it() -> None:
    about = Diagnostics(["door", "hall"])
    about.follow(7, [True, None], [True, False])
    data = base64.b64encode(about.message(5_000_000_007)).decode()
    ((heard,),) = asked([(ARRAY, data)])
    assert heard["header"] == {"frame_id": "", "stamp": {"sec": 5, "nanosec": 7}}
    door, hall = heard["status"]
    assert (door["level"], door["name"], door["message"]) == (
        0,
        "neurosnap: door",
        "on",
    )
    assert (hall["level"], hall["hardware_id"]) == (STALE, "hall")
    assert hall["values"][1:3] == [
        {"key": "believed", "value": "off"},
        {"key": "since", "value": "tick 7"},
    ]
