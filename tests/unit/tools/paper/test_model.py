"""Pictures of duals: what is parallel, what keeps its distance, what is left out."""

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.realization import corners
from tools.paper.model import find
from tools.paper.model_picture import _cells as cells_of
from tools.paper.model_picture import directions_of, picture
from tools.paper.spaces import EXAMPLES


@pytest.mark.slow
@pytest.mark.parametrize("text", [*EXAMPLES, "a, b, c, d", "a, b, c, d, e : a < b < c"])
def test_vertices_keep_apart_and_edges_have_a_length(text: str) -> None:
    poc, vertices = find(text).poc, find(text).vertices
    assert vertices is not None
    rows = corners(poc, vertices)
    number = {row.tobytes(): k for k, row in enumerate(rows)}
    _, squares = cells_of(rows, number)
    own = [a for a in poc.heads.tolist() if not a & 1]
    ways = directions_of(poc, own)
    points = rows @ ways
    one, two = np.triu_indices(len(points), 1)
    assert (np.linalg.norm(points[one] - points[two], axis=1) > 0.2).all()
    assert all(len(set(ring)) == 4 for ring in squares)
    if text == "grid":  # its thresholds are parallel, and cross the others
        assert len(np.unique(ways.round(6), axis=0)) == 2


def test_what_is_too_large_is_measured_and_left_out() -> None:
    large = find("a, b, c, d, e, f, g, h, i")
    assert large.vertices is None
    assert large.measures() == ["dual: more than 256 vertices · height 0 · width 18"]
    assert picture(large).axes
    some = find("a, b, c : a < b", only=["a", "b"])
    assert some.title.endswith("(2 of 3 sensors)")
    many = find(",".join(f"s{k}" for k in range(61)))
    with pytest.raises(InvalidValueError, match=r"^model: must have at most 120"):
        picture(many)
