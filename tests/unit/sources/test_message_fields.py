"""Terms say what is counted over a list, and errors say what there is instead."""

import math
import re
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.sources.message_fields import field, fields, parse_term

ITEMS = st.lists(st.none() | st.integers(-2, 2), max_size=6)


@given(ITEMS, st.none() | st.integers(0, 5), st.integers(1, 6), st.booleans())
def test_a_term_says_what_is_counted_one_by_one(
    items: list[int | None], start: int | None, more: int, array: bool
) -> None:
    numbers = [math.nan if n is None else float(n) for n in items]
    message = {"a": {"b": np.array(numbers) if array else numbers}}
    first, stop = start or 0, (start or 0) + more
    part = [n for n in items[first:stop] if n is not None]
    expected = {
        "min": min(part, default=None),
        "max": max(part, default=None),
        "mean": sum(part) / len(part) if part else None,
        "any": any(part) if part else None,
        "all": all(part) if part else None,
        "count": sum(n != 0 for n in part) if part else None,
    }
    for function, ends in product(expected, (True, False)):
        upto = stop if ends else ""
        term = parse_term(
            f"{function}(/t.a.b[{'' if start is None else start}:{upto}])"
        )
        assert term is not None
        if ends:
            assert dict(fields("/t", message, [term]))[term.name] == pytest.approx(
                expected[function]
            )


def test_a_term_without_a_slice_counts_all_and_knows_its_topic() -> None:
    term = parse_term("max(/t.a[1].b)")
    assert term is not None
    assert term.of("/t", {"a": [0, {"b": [True, 2, False]}]}) == 2
    assert [term.is_of(topic) for topic in ("/t", "/t.a", "/", "/u", "")] == [
        *(True, True, False, False, False)
    ]
    assert parse_term("median(/t.a)") is None
    with pytest.raises(InvalidValueError, match=r"^slice: must end behind its"):
        parse_term("min(/t.a[3:3])")


@pytest.mark.parametrize(
    ("path", "text"),
    [
        (".a.z", "must have the field .a.z (there are b, c)"),
        (".a.c[3]", "must have the field .a.c[3]"),
        (".a.b.c", "must have the field .a.b.c"),
        (".a..b", "must have the field .a..b"),
    ],
)
def test_a_wrong_path_is_named_with_what_is_there(path: str, text: str) -> None:
    message = {"a": {"b": 1, "c": [1, "x"]}}
    with pytest.raises(ValueError, match=f"^{re.escape(text)}$"):
        field(message, path)


def test_times_are_no_fields() -> None:
    stamp = {"sec": 1, "nanosec": 2}
    said = {"header": {"stamp": stamp, "frame": "a"}, "sec": 3, "at": {"sec": 1}}
    assert fields("/t", said) == [
        *(("/t.header.frame", "a"), ("/t.sec", 3), ("/t.at.sec", 1))
    ]


@pytest.mark.parametrize("path", ["/t.a", "/t.b", "/t.c", "/t.d"])
def test_what_is_no_list_of_numbers_is_refused(path: str) -> None:
    message = {"a": 1, "b": ["x"], "c": [[1], [2]], "d": [[1], 2]}
    term = parse_term(f"min({path})")
    assert term is not None
    rule = rf"^min\({path}\): must be of a list of numbers at {path}, got '"
    with pytest.raises(InvalidValueError, match=rule):
        term.of("/t", message)
