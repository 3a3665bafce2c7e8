"""Parts that a host starts: cells chosen by number, and a world named by the host."""

import pytest

from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.coordinator_process import RunDescription
from neurosnap.runtime.parts.world_process import WorldJob
from neurosnap.runtime.remote_parts import among, parse_ranges, world
from tests.support.run_options import options_for

LIKE, ONCE, OF = (
    "be like 0-499 or .*",
    "name each once",
    "be cells of the swarm, 0 to 21",
)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [("0", [0]), ("7-7", [7]), ("0-3,7", [0, 1, 2, 3, 7]), (" 9, 2-3 ", [2, 3, 9])],
)
def test_ranges_are_read(text: str, numbers: list[int]) -> None:
    assert among(parse_ranges("cells", text), "cells", 22) == numbers


@pytest.mark.parametrize(
    ("text", "rule", "got"),
    [
        *[
            (text, LIKE, ".*")
            for text in ("", "a", "-", "-1", "1,,2", "1-2-3", "9-3,1", "1,4-3", "2-")
        ],
        *[(text, LIKE, ".*") for text in ("0-99999999999", "٣")],
        *[(text, ONCE, ".*") for text in ("1,1", "0-4,4-5", "3,0-9")],
        ("999999", OF, "999999"),
        ("3,22", OF, "22"),
    ],
)
def test_what_is_no_range_of_what_there_is_is_refused(
    text: str, rule: str, got: str
) -> None:
    with pytest.raises(InvalidValueError, match=rf"^cells: must {rule}, got {got}$"):
        among(parse_ranges("cells", text), "cells", 22)


def test_a_world_opens_what_its_own_host_names() -> None:
    named = world(("neurosnap/Path-v0", {}))
    options = options_for("neurosnap/Path-v0", 1, {"places": 6})
    (part,) = named("demo", RunDescription(options=options))
    assert part.job == WorldJob(options, None)
    other = RunOptions(source="/etc/rows.csv", body=Body(own=("a",)))
    rule = "^source: must be '/etc/rows.csv' here, got 'neurosnap/Path-v0'"
    with pytest.raises(InvalidValueError, match=rule):
        named("demo", RunDescription(options=other))
