"""What the verbs share: errors in the words they came in, and lists of numbers."""

import pytest
import typer

from neurosnap.apps.cli.shared import errors, open_ranges, ranges
from neurosnap.errors import InvalidValueError, NeurosnapError


@pytest.mark.parametrize(
    "text",
    [r"\[/b]", "[/red]", "[b]bold[/b]", "[link=file:/x]", "\\", "a\\[x]\\", "[]"],
)
def test_an_error_is_told_in_its_own_words(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as ended, errors():
        raise NeurosnapError(text)
    assert ended.value.exit_code == 1
    assert capsys.readouterr().err == f"error: {text}\n"


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("0", [0]),
        ("7-7", [7]),
        ("0-3,7", [0, 1, 2, 3, 7]),
        (" 9, 2-3 ", [2, 3, 9]),
        ("999999", [999_999]),
    ],
)
def test_ranges_are_read(text: str, numbers: list[int]) -> None:
    assert ranges("cells", text) == numbers


@pytest.mark.parametrize(
    "text",
    ["", "a", "1-", "-1", "1,,2", "1-2-3", "9-3,1", "1,4-3", "0-99999999999", "٣"],
)
def test_what_is_no_range_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^cells: must be like 0-499 or .*got"):
        ranges("cells", text)


@pytest.mark.parametrize("text", ["1,1", "0-4,4-5", "3,0-9"])
def test_a_number_given_twice_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^cells: must name each once, got"):
        ranges("cells", text)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("20-", [20, 21]),
        ("0,3-4, 21-", [0, 3, 4, 21]),
        ("2-3", [2, 3]),
        ("0-", list(range(22))),
    ],
)
def test_the_last_range_may_be_open(text: str, numbers: list[int]) -> None:
    assert open_ranges("cells", text).of("cells", 22) == numbers


@pytest.mark.parametrize("text", ["-", "20-,3", ",20-", "2--", "20-*", "3,,4-"])
def test_what_is_no_open_range_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^cells: must be like 0-499 or .*got"):
        open_ranges("cells", text)


@pytest.mark.parametrize("text", ["3,3-", "0-4,2-"])
def test_an_open_range_names_no_number_twice(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^cells: must name each once, got"):
        open_ranges("cells", text)


@pytest.mark.parametrize(("text", "last"), [("22-", 22), ("3,25", 25), ("40,50-", 50)])
def test_a_range_is_of_what_there_is(text: str, last: int) -> None:
    rule = rf"^cells: must be cells of the swarm, 0 to 21, got {last}$"
    with pytest.raises(InvalidValueError, match=rule):
        open_ranges("cells", text).of("cells", 22)
