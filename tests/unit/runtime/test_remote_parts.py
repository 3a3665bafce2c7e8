"""What a host starts of a swarm: cells by number, and the world that it names."""

import msgspec
import pytest

from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.coordinator_process import RunDescription
from neurosnap.runtime.parts.world_process import WorldJob
from neurosnap.runtime.recorded_source import Trust
from neurosnap.runtime.remote_parts import among, parse_ranges, world
from tests.support.run_options import options_for

BROKER: dict[str, bool | int | float | str] = {
    "options": msgspec.json.encode(
        {
            "kind": "mqtt",
            "broker": {"host": "10.0.0.1", "username": "u", "password_file": "/x"},
            "sensors": [{"name": "a", "topic": "a"}],
        }
    ).decode()
}
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


@pytest.mark.parametrize(
    ("options", "named", "rule"),
    [
        (
            options_for("neurosnap/Path-v0", 1, {"places": 6}),
            ("neurosnap/Path-v0", {}),
            "",
        ),
        (
            RunOptions(source="mqtt:", arguments=BROKER, body=Body(own=("a",))),
            ("mqtt:", {}),
            "^arguments: must hold the options of an MQTT source",
        ),
        (
            RunOptions(source="m:E-v0", arguments={"path": "/x"}, body=Body(own=())),
            ("m:E-v0", {}),
            r"^arguments: must be named here, too, as \{'path': '/x'\}, got \{\}",
        ),
        (
            RunOptions(source="/etc/rows.csv", body=Body(own=("a",))),
            ("neurosnap/Path-v0", {}),
            "^source: must be '/etc/rows.csv' here, got 'neurosnap/Path-v0'",
        ),
    ],
)
def test_a_world_opens_what_its_own_host_names(
    options: RunOptions, named: Trust, rule: str
) -> None:
    description = RunDescription(options=options)
    if rule:
        with pytest.raises(InvalidValueError, match=rule):
            world(named)("demo", description)
        return
    (part,) = world(named)("demo", description)
    assert part.job == WorldJob(options, None)
