"""Realisations: the states of points, violated relations, and invalid input."""

import re
from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.realization import Realization
from neurosnap.poc.order.pocset import PocSet

FIELDS = [[1, 1, 0, 0], [0, 1, 1, 0]]


def test_points_show_vertices_and_vertices_have_witnesses() -> None:
    shown = Realization(FIELDS, ["a", "b"])
    assert str(shown.poc_set()) == "a, b"
    assert shown.vertex(1).nonzero()[0].tolist() == [0, 2]
    assert len(shown.vertices()) == 4
    assert shown.witnesses([0]).tolist() == [True, True, False, False]
    assert shown.witnesses([0, 3]).tolist() == [True, False, False, False]
    assert shown.witnesses([0, 1]).tolist() == [False] * 4
    *cubes, square = shown.punctured()
    assert (len(cubes), square) == (8, (1, 2, 0, 3))


def test_points_that_break_a_relation_leave_the_dual() -> None:
    """[GK] defn:punctured dual: consistent vertices that are in the dual."""
    shown = Realization(FIELDS, ["a", "b"])
    believed = PocSet.parse("a, b : a < b*")
    assert len(shown.vertices(believed)) == 3
    assert shown.punctured(believed) == [(0,), (1,), (2,), (0, 2), (1, 2)]
    with pytest.raises(InvalidValueError, match=r"^poc set: must be on \['a', 'b'\]"):
        shown.vertices(PocSet.parse("a, c"))


def test_fields_cannot_be_changed() -> None:
    given = np.array(FIELDS, np.bool_)
    shown = Realization(given)
    given[:] = False
    assert shown.fields.any()
    assert not shown.fields.flags.writeable
    assert shown.sensorium.names == ("s0", "s1")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[1, 0], [1]],), "field of s1: must have 2 points as the first has, got (1"),
        (([[1, 0], [1, 2]], ["a", "b"]), "field of b: must be made of bits, 0 or 1"),
        (([[]],), "fields: must be over at least one point, got (1, 0)"),
        (([[1]], ["a", "b"]), "fields: must be 2, one a sensor, got 1"),
        (([["x"]],), "field of s0: must be made of bits, 0 or 1, got ['x']"),
        (("ab",), "fields: must be one row of bits a sensor, got 'ab'"),
        (([3],), "field of s0: must have 0 points as the first has, got ()"),
    ],
)
def test_bad_realizations_are_refused(arguments: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(message)}"):
        Realization(*arguments)


@pytest.mark.parametrize("point", [4, -1, "x", True, None])
def test_unknown_points_are_refused(point: Any) -> None:
    with pytest.raises(
        InvalidValueError, match=r"^point: must be the number of one of 4"
    ):
        Realization(FIELDS).vertex(point)
