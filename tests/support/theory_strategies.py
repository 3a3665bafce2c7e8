"""Hypothesis strategies for poc sets and their generating implications."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.realization import Realization
from neurosnap.poc.order.pocset import PocSet
from tests.support.edges import edges_of
from tests.support.strategies import bit_rows, graphs
from tests.support.theory_oracles import Model, Vertex, included


@dataclass(frozen=True)
class Drawn:
    """A poc set, and the model of the same relations by definition."""

    p: PocSet
    model: Model

    @property
    def cubing(self) -> Cubing:
        return Cubing(self.p)

    def __repr__(self) -> str:
        return repr(self.p)


def order_of(p: PocSet) -> Model:
    """The model of a poc set that the code under test has made."""
    return Model(p.minimum, sorted(edges_of(p.order)))


@st.composite
def relations(draw: st.DrawFn, most: int = 7) -> Drawn:
    """Draw a poc set from random relations."""
    graph = draw(graphs(most))
    edges = sorted(edges_of(graph.edges))
    p = PocSet(graph.sensors, edges)
    return Drawn(p, Model(2 * graph.sensors, edges))


@st.composite
def fields(draw: st.DrawFn, most: int = 7, points: int = 9) -> list[list[bool]]:
    """Draw where each of some sensors is on."""
    count = draw(st.integers(1, points))
    row = bit_rows(count)
    return draw(st.lists(row, min_size=1, max_size=most))


@st.composite
def realized(draw: st.DrawFn, most: int = 7) -> Drawn:
    """Draw a poc set from a random realisation."""
    rows = draw(fields(most))
    return Drawn(Realization(rows).poc_set(), Model(2 * len(rows), included(rows)))


def poc_sets(most: int = 7) -> st.SearchStrategy[Drawn]:
    """Draw a weak poc set, from relations or from a realisation."""
    return relations(most) | realized(most)


def sets_of(model: Model) -> st.SearchStrategy[set[int]]:
    """Draw any set of literals."""
    if not model.n:
        return st.just(set())
    return st.sets(st.integers(0, model.n - 1), max_size=4)


def coherent_sets(model: Model) -> st.SearchStrategy[set[int]]:
    """Draw a coherent set of literals: some of a vertex, or all."""
    return st.sampled_from(model.vertices).flatmap(
        lambda u: st.sets(st.sampled_from(sorted(u))) if u else st.just(set())
    )


def array(literals: set[int] | Vertex, n: int) -> NDArray[np.bool_]:
    """Return a set of literals as the code takes it."""
    chosen = np.zeros(n, np.bool_)
    chosen[sorted(literals)] = True
    return chosen


def frozen(literals: NDArray[np.bool_]) -> Vertex:
    """Return an array as a set of literals."""
    return frozenset(literals.nonzero()[0].tolist())
