"""Sources are opened by name; a live one reports missing options."""

import os
import sys

import pytest

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.open import open_live, settle
from neurosnap.sources.protocol import Argument


@pytest.mark.parametrize(
    ("sensors", "names"),
    [
        ("door, motion", ("door", "motion")),
        ("door", ("door",)),
        ('["a,b", "c"]', ("a,b", "c")),
    ],
)
def test_names_come_with_commas_or_as_a_list(
    sensors: str, names: tuple[str, ...]
) -> None:
    source = open_live("-", {"sensors": sensors})
    source.close()
    assert source.sensors == names
    assert source.orders == (0,) * len(names)
    assert source.actions == ()


@pytest.mark.parametrize(
    ("spec", "arguments", "text"),
    [
        ("-", {}, "sensors: must be named for such a source"),
        ("zenoh:", {}, "sensors: must be named for such a source"),
        (
            "http:",
            {"sensors": "a"},
            "source: must be -, zenoh:, mqtt: or ros2:, got 'http:'",
        ),
        ("-", {"sensors": "a,a"}, "names: must be unique, got 'a'"),
        ("-", {"sensors": "[1]"}, "sensors: must be names with commas between them"),
        ("-", {"sensors": "a", "stale": 3}, "arguments: must be ones such a source"),
        ("-", {"sensors": "a", "stale_after": 0}, "arguments: must be ones such a"),
        (
            "-",
            {"sensors": "a", "interval": 1, "max_interval": 2},
            "arguments: must be ones such a source takes (interval: must not come with",
        ),
    ],
)
def test_what_is_wrong_is_said(
    spec: str, arguments: dict[str, Argument], text: str
) -> None:
    with pytest.raises(InvalidValueError) as caught:
        open_live(spec, arguments)
    assert str(caught.value).startswith(text)


def test_settling_reads_the_first_line_where_nobody_named_the_sensors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reads, writes = os.pipe()
    os.write(writes, b'{"bits": {"a,b": 1, "c": 0}}\n{"bits": [0, 0]}\n')
    os.close(writes)
    kept = os.dup(0)
    os.dup2(reads, 0)
    try:
        named: dict[str, Argument] = {"sensors": "x,y"}
        assert settle("-", named) == named
        assert settle("zenoh:", {}) == {}
        settled = settle("-", {"stale_after": 5.0})
        source = open_live("-", settled)
        first, second = source.first(), source.step(-1)
        assert source.step(-1) is None
        source.close()
    finally:
        os.dup2(kept, 0)
        os.close(kept)
        os.close(reads)
    assert settled["stale_after"] == 5.0
    assert source.sensors == ("a,b", "c")
    assert first is not None
    assert second is not None
    assert first.bits.tolist() == [True, False]
    assert second.bits.tolist() == [False, False]


def test_a_swarms_own_keys_need_a_hub() -> None:
    source = open_live("zenoh:", {"sensors": "a"})
    rule = r"^source: must be a swarm's with a hub, cells in processes, got 'zenoh:'$"
    with pytest.raises(NeurosnapError, match=rule):
        source.first()
    source.close()


def test_settling_says_what_is_wrong() -> None:
    with pytest.raises(InvalidValueError, match=r"^arguments: must be ones such a"):
        settle("-", {"nonsense": sys.maxsize})
