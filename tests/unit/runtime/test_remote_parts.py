"""Lists of numbers, as those who start some cells give them."""

import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.runtime.remote_parts import parse_numbers


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("0", [0]),
        ("7-7", [7]),
        ("0-3,7", [0, 1, 2, 3, 7]),
        (" 9, 2-3 ", [2, 3, 9]),
        ("20-", [20, 21]),
        ("0,3-4, 21-", [0, 3, 4, 21]),
        ("0-", list(range(22))),
    ],
)
def test_ranges_are_read_and_the_last_may_be_open(
    text: str, numbers: list[int]
) -> None:
    assert parse_numbers("cells", text).among("cells", 22) == numbers


@pytest.mark.parametrize(
    "text",
    [
        *("", "a", "-", "-1", "1,,2", "1-2-3", "9-3,1", "1,4-3", "0-99999999999", "٣"),
        *("20-,3", ",20-", "2--", "20-*", "3,,4-"),
    ],
)
def test_what_is_no_range_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^cells: must be like 0-499 or .*got"):
        parse_numbers("cells", text)


@pytest.mark.parametrize("text", ["1,1", "0-4,4-5", "3,0-9", "3,3-", "0-4,2-"])
def test_a_number_given_twice_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^cells: must name each once, got"):
        parse_numbers("cells", text)


@pytest.mark.parametrize(
    ("text", "last"), [("999999", 999_999), ("22-", 22), ("3,25", 25), ("40,50-", 50)]
)
def test_a_range_is_of_what_there_is(text: str, last: int) -> None:
    rule = rf"^cells: must be cells of the swarm, 0 to 21, got {last}$"
    with pytest.raises(InvalidValueError, match=rule):
        parse_numbers("cells", text).among("cells", 22)
