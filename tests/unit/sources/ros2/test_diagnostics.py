"""What is said of sensors to programs of ROS 2 follows from tick to tick."""

from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from neurosnap.sources.ros2.diagnostics import (
    ARRAY,
    ERROR,
    OK,
    STALE,
    WARN,
    Bit,
    Diagnostics,
    said_of,
)

WRONG = {"culprits": ["door"], "candidates": ["door", "hall"], "text": "tick 3: no"}


@pytest.mark.parametrize(
    ("sensor", "reads", "believed", "wrong", "level", "message", "why"),
    [
        ("door", True, True, None, OK, "on", ""),
        ("door", False, False, None, OK, "off", ""),
        ("lamp", True, True, WRONG, OK, "on", ""),
        ("door", True, None, None, WARN, "on: not believed", ""),
        ("hall", True, True, WRONG, WARN, "on: may contradict what", "tick 3: no"),
        ("door", None, None, None, STALE, "not known", ""),
        ("door", None, False, None, STALE, "not known, believed off", ""),
        ("hall", None, True, WRONG, STALE, "not known, believed on", "tick 3: no"),
        ("door", False, True, WRONG, ERROR, "off: contradicts what", "tick 3: no"),
        ("door", None, None, WRONG, ERROR, "unknown: contradicts what", "tick 3: no"),
    ],
)
def test_its_level_is_the_worst_that_is_known(
    sensor: str,
    reads: Bit,
    believed: Bit,
    wrong: dict[str, Any] | None,
    level: int,
    message: str,
    why: str,
) -> None:
    said = said_of(sensor, reads, believed, wrong)
    words = {None: "unknown", True: "on", False: "off"}
    assert (said.level, said.why) == (level, why)
    assert said.message.startswith(message)
    assert (said.reads, said.believed) == (words[reads], words[believed])


def test_it_is_told_since_when_and_whether_anything_is_new() -> None:
    said, store = Diagnostics(["door", "hall\u202e"]), get_typestore(Stores.ROS2_KILTED)

    def since() -> list[str]:
        array: Any = store.deserialize_cdr(said.message(3 * 10**9 + 7), ARRAY)
        assert (array.header.stamp.sec, array.header.stamp.nanosec) == (3, 7)
        names = [status.hardware_id for status in array.status]
        assert names == ["door", "hall\\u202e"]
        return [status.values[2].value for status in array.status]

    assert said.follow(1, [True, True], [True, True])
    assert since() == ["tick 1", "tick 1"]
    assert not said.follow(2, [True, True], [True, True])
    assert said.follow(3, [True, False], [True, False], WRONG)
    assert since() == ["tick 3", "tick 3"]
    # The same anomaly, told by other words.
    assert said.follow(4, [True, False], [True, False], {**WRONG, "text": "tick 4"})
    assert since() == ["tick 3", "tick 3"]
    assert said.follow(5, [True, None], [True, None])
    assert since() == ["tick 5", "tick 5"]
    assert not said.follow(6, [True, None], [True, None])
