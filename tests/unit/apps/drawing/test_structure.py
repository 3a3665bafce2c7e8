"""A model as data: what other programs get is the order and the dual, whole."""

import itertools
import json
import subprocess
import sys

import numpy as np
import pytest

from neurosnap.apps.drawing.find_model import find, listed
from neurosnap.apps.drawing.measures import measure
from neurosnap.apps.drawing.structure import structure
from neurosnap.errors import UnknownSensorError
from neurosnap.poc.dual.homology import CellComplex


def test_equal_literals_are_one_element_and_what_is_nowhere_none() -> None:
    found = structure(find("a, b, c, d, e : a < b, c = d*, e < e*"))
    assert found.elements == (("a",), ("b",), ("c", "d*"))
    assert found.negligible == ("e",)
    assert found.order == (("a", "b"), ("b*", "a*"), ("e", "e*"))
    assert found.dual is not None
    # a implies b; c is free.
    assert set(found.dual.vertices) == {"000", "001", "010", "011", "110", "111"}
    assert found.dual.witnessed is found.dual.possible is None


@pytest.mark.parametrize("name", list(listed()))
def test_the_cubes_are_those_of_the_dual(name: str) -> None:
    """Built again from the data alone it has the same numbers."""
    model = find(name)
    numbers, dual = measure(model), structure(model).dual
    assert dual is not None
    assert numbers.faces == (len(dual.vertices), *map(len, dual.cubes))
    rows = np.array([[bit == "1" for bit in vertex] for vertex in dual.vertices])
    every = {vertex: k for k, vertex in enumerate(dual.vertices)}
    for dimension, cubes in enumerate(dual.cubes, 1):
        assert len(set(cubes)) == len(cubes)
        for corner, *ways in cubes:
            assert len(ways) == dimension
            for off in itertools.product((0, 1), repeat=dimension):
                row = rows[corner].copy()
                assert row[ways].all()
                row[ways] = off
                assert "".join("01"[bit] for bit in row.tolist()) in every
    assert CellComplex.cubical(rows).betti_numbers() == numbers.betti
    if dual.witnessed is not None:
        assert len(dual.witnessed) == numbers.witnessed
        punctured = CellComplex.cubical(rows[list(dual.witnessed)])
        assert punctured.betti_numbers() == numbers.punctured_betti


def test_some_sensors_keep_the_order_among_them() -> None:
    model = find("a, b, c, d : a < b < c", only=("c", "a"))
    assert str(model.poc) == "c, a : a < c"
    arcs = find("six-arcs", only=("a0", "a3"))
    assert arcs.marks == ()
    assert arcs.witnessed is not None
    assert structure(arcs).dual is not None
    assert measure(arcs).faces == (3, 2)
    with pytest.raises(UnknownSensorError, match="q"):
        find("six-arcs", only=("a0", "q"))


@pytest.mark.slow
def test_no_matplotlib_is_needed() -> None:
    """In a process of its own: this one may have loaded it."""
    script = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("matplotlib", "PIL"):
            raise ImportError(f"{name} is not installed here")
sys.meta_path.insert(0, Missing())
from neurosnap.__main__ import main
sys.argv = ["neurosnap", "model", "six-arcs", "--json"]
main()
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["faces"] == [13, 18, 6]
    assert facts["betti"] == [1, 0, 0]
    assert facts["punctured_betti"] == [1, 1]
    assert len(facts["dual"]["vertices"]) == 13
    assert [len(cubes) for cubes in facts["dual"]["cubes"]] == [18, 6]
