"""Poc sets: their syntax, derived relations, and invalid input."""

import re
from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError, UnknownSensorError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a,b,c : a<c*, b<c*", "a, b, c : a < c*, b < c*"),
        ("a,b:a<b", "a, b : a < b"),
        ("  a ,  b  :  b*   <=   a* ", "a, b : a < b"),
        ("a, b, c : a <= b ≤ c", "a, b, c : a < b, b < c"),
        ("a, b : a = b*", "a, b : a = b*"),
        ("a, b : a <= b, b <= a", "a, b : a = b"),
        ("a : a < a*", "a : a < a*"),
        ("a, b", "a, b"),
        ("a, b :", "a, b"),
        ("a, b : a < b,", "a, b : a < b"),
        ("", ""),
    ],
)
def test_text_is_read_and_shown_again(text: str, shown: str) -> None:
    poc = PocSet.parse(text)
    assert str(poc) == shown
    assert PocSet.parse(str(poc)) == poc


def test_the_worked_example_of_generators_and_relations() -> None:
    """[GK] example:generators and relations."""
    poc = PocSet.parse("a, b, c : a < c, b < c")
    assert poc.hasse() == [(0, 4), (2, 4), (5, 1), (5, 3)]
    assert (poc.name(6), poc.name(7), poc.name(5)) == ("0", "1", "c*")
    assert poc.height() == 1  # without the bounds
    nothing = PocSet(0)  # has the two bounds alone
    assert (nothing.hasse(), nothing.minimum, nothing.maximum) == ([], 0, 1)
    assert (nothing.height(), nothing.leq(1, 0)) == (0, False)


def test_lists_say_the_same_by_name_and_by_number() -> None:
    text = PocSet.parse("a, b, c : a < b, b <= c*, a = a")
    assert text == PocSet(["a", "b", "c"], [("a", "<", "b"), ("b", "c*"), (0, "=", 0)])
    assert text == PocSet(Sensorium(["a", "b", "c"]), ["a < b <= c*"])
    assert hash(text) == hash(PocSet(["a", "b", "c"], [(0, 2), (2, 5)]))
    assert text != PocSet(3, [(0, 2), (2, 5)])
    assert text != "a, b, c"


def test_a_graph_with_names_and_without() -> None:
    graph = PocGraph.from_implications(2, [(0, 2)])
    assert str(PocSet.from_graph(graph)) == "s0, s1 : s0 < s1"
    named = PocSet.from_graph(graph, Sensorium(["door", "motion"]))
    assert str(named) == "door, motion : door < motion"
    assert named.graph is graph
    with pytest.raises(ShapeError, match=r"^sensorium: must have 2 sensors, got 1"):
        PocSet.from_graph(graph, Sensorium(["door"]))
    given: Any = "door"
    with pytest.raises(InvalidValueError, match=r"^graph: must be a PocGraph"):
        PocSet.from_graph(given)


CYCLE = "relations: must have no cycle through a strict one, got"
EQUAL = "relations: must not make a literal equal to its complement, got"
JOINED = "relation: must be literals joined by <, <= or =, got"
FORM = "relation: must be (a, b), (a, sign, b) or text, got"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("a, b : a < b, b < a", CYCLE),
        ("a, b : a < b, b <= a", CYCLE),
        ("a : a < a", f"{CYCLE} 'a < a'"),
        ("a, b, c : a <= b < c, c <= a", f"{CYCLE} 'b < c'"),
        ("a, b : a <= b, b < a*, a* <= b*, b* <= a", f"{EQUAL} 'a'"),
        ("a : a = a*", EQUAL),
        ("a, b : a <", f"{JOINED} 'a <'"),
        ("a, b : a b", f"{JOINED} 'a b'"),
        ("a, b : a < < b", JOINED),
        ("a < b", "generator: must hold no <, ≤ or =; relations follow a colo"),
        ("a, , b", "sensor name: must not be empty, got ''"),
        ("a, a*", "sensor name: must not end with *, got 'a*'"),
        ("a, a", "names: must be unique, got 'a'"),
        # Relations between two sensors.
        ((2, [(0, ">", 2)]), "relation sign: must be <, <= or =, got '>'"),
        ((2, [(0,)]), f"{FORM} (0,)"),
        ((2, [7]), f"{FORM} 7"),
        ((2, "a < b"), "relations: must be several, not one text"),
        ((2, [(0, 4)]), "literal: must be a literal"),
    ],
)
def test_what_makes_no_poc_set_is_refused(given: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(message)}"):
        PocSet(*given) if isinstance(given, tuple) else PocSet.parse(given)


def test_unknown_names_and_numbers_are_refused() -> None:
    with pytest.raises(UnknownSensorError, match=r"^literal: must name .* got 'x\*'"):
        PocSet.parse("a : a < x*")
    poc = PocSet.parse("a, b : a < b")
    with pytest.raises(UnknownSensorError, match=r"^literal: must name"):
        poc.leq("a", "c")
    with pytest.raises(InvalidValueError, match=r"^element: must be .* got 6"):
        poc.leq(0, 6)


def test_sums_keep_names_apart() -> None:
    one, two = PocSet.parse("a, b : a < b"), PocSet.parse("c")
    assert str(one | two) == "a, b, c : a < b"
    with pytest.raises(InvalidValueError, match=r"^sensor name: must not be in both"):
        one.direct_sum(PocSet.parse("c, b"))
    given: Any = "c"
    with pytest.raises(InvalidValueError, match=r"^summand: must be a PocSet"):
        one.direct_sum(given)


def test_what_is_given_out_cannot_be_changed() -> None:
    poc = PocSet.parse("a, b : a < b")
    for array in (poc.order, poc.negligible, poc.heads):
        assert not array.flags.writeable
    proper = poc.proper
    proper[:] = False
    assert poc.proper.all()
    assert isinstance(poc.order, np.ndarray)
