"""Automatic thresholds match their definition, and what they derive is an order."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.sensorium import Sensorium
from tests.support import oracles
from tests.support.edges import learned_edges
from tests.support.hypothesis_settings import examples
from tests.support.strategies import as_set

Bits = NDArray[np.bool_]
Square = dict[tuple[int, int], int]
"""The weights of a pair of sensors by the literals that are on: 0, or 1 for a star."""
TURNS = 32
AGAINST = {1: (0, 1), 2: (1, 0), 4: (0, 0), 8: (1, 1)}
"""What each code is broken by, as the bits of `pair_codes` have it."""


@st.composite
def noisy_walks(draw: st.DrawFn, most: int = 5) -> tuple[Bits, Bits]:
    """Draw readings of sensors that imply each other up to noise, and what is known.

    They last, so that there are few occasions, or change at every tick.
    """
    sensors, ticks = draw(st.integers(2, most)), draw(st.integers(1500, 2600))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    lasts = draw(st.sampled_from([1, 5, 40]))
    level = rng.random(ticks // lasts + 1).repeat(lasts)[:ticks, np.newaxis]
    own = rng.random((ticks // lasts + 1, sensors)).repeat(lasts, axis=0)[:ticks]
    of_one = rng.random(sensors) < 0.7
    bits = np.where(of_one, level, own) < rng.random(sensors)
    bits ^= rng.random(bits.shape) < draw(st.sampled_from([0, 0.001, 0.01, 0.02]))
    known = np.ones_like(bits)
    if draw(st.booleans()):
        known = rng.random(bits.shape) < 0.9
    return bits, known


class Plain:
    """What the definition says, counted anew in whole numbers and fractions."""

    def __init__(self, sensors: int) -> None:
        self.tick, self.sensors = 0, sensors
        self.codes = {(i, j): 0 for i in range(sensors) for j in range(i)}
        self.squares: dict[tuple[int, int], Square] = {
            pair: {(x, y): 0 for x in (0, 1) for y in (0, 1)} for pair in self.codes
        }
        self.read: list[list[int]] = [[] for _ in range(sensors)]
        """All known readings of each sensor: 0, or 1 for a star."""

    def learn(self, bits: NDArray[np.bool_], known: NDArray[np.bool_]) -> None:
        self.tick += 1
        stars = [int(not bit) for bit in bits]
        for sensor in known.nonzero()[0].tolist():
            self.read[sensor].append(stars[sensor])
        for pair, square in self.squares.items():
            i, j = pair
            if known[i] and known[j]:
                square[stars[i], stars[j]] += 1
            code = code_of(square, self.tick)
            if code > 0 and square[AGAINST[code]]:
                if known[i] and len(self.read[i]) % TURNS == 0:
                    stands = self.passes(i, j, code)
                else:
                    stands = self.codes[pair] == code
                code = code if stands else 0
            self.codes[pair] = code

    def passes(self, i: int, j: int, code: int) -> bool:
        """Whether the exceptions are surely less than half of those by chance."""
        w, (x, y) = self.squares[i, j], AGAINST[code]
        stays = staying(self.read[i], x) * staying(self.read[j], y)
        if stays == 1:
            return False
        k, lasting = w[x, y], 1 / (1 - stays)
        half = Fraction(w[x, 0] + w[x, 1], sum(w.values())) * (w[0, y] + w[1, y]) / 2
        return k < half and (half - k) ** 2 > 6 * lasting * (half + k)

    def edges(self) -> set[tuple[int, int]]:
        found = set()
        for (i, j), code in self.codes.items():
            ways = {
                1: [(2 * i, 2 * j)],
                2: [(2 * j, 2 * i)],
                4: [(2 * i, 2 * j + 1)],
                8: [(2 * i + 1, 2 * j)],
                -1: [(2 * i, 2 * j), (2 * j, 2 * i)],
                -2: [(2 * i, 2 * j + 1), (2 * j + 1, 2 * i)],
                0: [],
            }[code]
            found |= {edge for a, b in ways for edge in ((a, b), (b ^ 1, a ^ 1))}
        return found


def code_of(w: Square, age: int) -> int:
    """The code of a pair if exceptions need only be few; -1, -2: an equivalence."""
    total = sum(w.values())
    line = Fraction(total, 32) - 48
    if not total or (2 * total < age and line < 1):
        return 0
    if w[0, 1] == w[1, 0] == 0:
        return -1
    if w[0, 0] == w[1, 1] == 0:
        return -2
    for code, (x, y) in AGAINST.items():
        k, others = w[x, y], [n for place, n in w.items() if place != (x, y)]
        if k < min(others) and (k == 0 or k < line):
            return code
    return 0


def staying(read: list[int], star: int) -> Fraction:
    """After what share of its ticks a literal's sensor still read the same."""
    ended = sum(now == star != then for now, then in pairwise(read))
    return 1 - Fraction(ended, read.count(star))


@examples(15)
@given(noisy_walks(), st.integers(1, 1400))
def test_it_is_what_its_observations_say(walk: tuple[Bits, Bits], cut: int) -> None:
    bits, known = walk
    snapshot, plain = EmpiricalSnapshot(bits.shape[1], "auto"), Plain(bits.shape[1])
    whole, resumed = known.all(), Snapshot.from_bytes(snapshot.to_bytes())
    for tick, (now, sure) in enumerate(zip(bits, known, strict=True), 1):
        snapshot.observe(now, None if whole else sure)
        plain.learn(now, sure)
        assert learned_edges(snapshot) == plain.edges()
        if tick == len(bits) - cut:
            resumed = Snapshot.from_bytes(snapshot.to_bytes())
            assert learned_edges(resumed) == learned_edges(snapshot)
        elif tick > len(bits) - cut:
            resumed.observe(now, None if whole else sure)
    assert resumed.to_bytes() == snapshot.to_bytes()
    for (i, j), square in plain.squares.items():
        code = code_of(square, plain.tick)
        if code > 0 and (k := square[AGAINST[code]]):
            x, y = AGAINST[code]
            found = snapshot.evidence(2 * i + x, 2 * j + (1 - y))
            assert (found.against, found.against < found.limit) == (
                k,
                plain.passes(i, j, code),
            )
    table = np.where(known, bits, np.nan)
    fitted = EmpiricalSnapshot.fit(table, "auto")
    assert fitted.to_bytes() == snapshot.to_bytes()


@examples(40)
@given(noisy_walks(most=8))
def test_whatever_is_tolerated_the_order_is_one(walk: tuple[Bits, Bits]) -> None:
    bits, _ = walk
    snapshot, broken = EmpiricalSnapshot(bits.shape[1], "auto"), 0
    for tick, now in enumerate(bits, 1):
        state = as_set(snapshot.observe(now))
        if tick % 97 and tick != len(bits):
            continue
        edges = learned_edges(snapshot, equivalences=False)
        assert not oracles.has_cycle(edges)
        assert {(b ^ 1, a ^ 1) for a, b in edges} == edges
        square_of = {(a & ~1, b & ~1): 0 for a, b in edges if a > b}
        for a, b in edges:
            on_a, on_b = now[a >> 1] != (a & 1), now[b >> 1] != (b & 1)
            broken += on_a and not on_b
            if a > b:
                square_of[a & ~1, b & ~1] += 1
            found = snapshot.evidence(a, b)
            assert found == _turned(snapshot.evidence(b ^ 1, a ^ 1))
            assert found.against < min(found.both, found.neither, found.other)
            assert found.against < max(1, tick / 32 - 48)
        assert all(count == 1 for count in square_of.values())
        graph = snapshot.poc_graph()
        assert not any(b ^ 1 in state for a in state for b in as_set(graph.up([a])))


def _turned(found: object) -> object:
    """The evidence for an implication as that for its contrapositive."""
    values = {name: getattr(found, name) for name in type(found).__slots__}  # type: ignore[attr-defined]
    values["both"], values["neither"] = values["neither"], values["both"]
    return type(found)(**values)


def test_a_grown_sensor_is_as_it_was_after_it_is_saved() -> None:
    rng = np.random.default_rng(4)
    sensorium, history = Sensorium(["a", "b", "free"]), History(3, 8192)
    snapshot = EmpiricalSnapshot(sensorium, "auto")
    known = np.array([True, True, False])
    for level in rng.random(3000):
        bits = np.array([level < 0.3, level < 0.6, False]) ^ (rng.random(3) < 0.01)
        snapshot.observe(bits, known)
        history.record(bits, known)
    on, off = history.ticks_of(0), history.ticks_of(1)
    newborn = answered(snapshot.newborn(2, history.ticks, on, off), history.answer)
    # Nothing is tolerated of it before it is read.
    assert newborn.codes.tolist() == [3, 0]
    snapshot.grow(2, "new", newborn, None)
    for level in rng.random(200):
        again = Snapshot.from_bytes(snapshot.to_bytes())
        assert again.to_bytes() == snapshot.to_bytes()
        assert learned_edges(again) == learned_edges(snapshot)
        bits = np.array([level < 0.3, level < 0.6, level < 0.3])
        snapshot.observe(bits ^ (rng.random(3) < 0.01))
    assert snapshot.evidence(4, 2).holds
    assert snapshot.evidence(4, 2).against > 0
    snapshot.silence(2)
    assert not snapshot.poc_graph().edges[4:].any()
    assert Snapshot.from_bytes(snapshot.to_bytes()).to_bytes() == snapshot.to_bytes()


def test_what_cannot_choose_is_refused() -> None:
    assert EmpiricalSnapshot(2, "auto").threshold == "auto"
    with pytest.raises(InvalidValueError, match=r"^threshold: must be a number for a"):
        DiscountedSnapshot(2, "auto")
    with pytest.raises(InvalidValueError, match=r"^threshold: must be a number, or"):
        EmpiricalSnapshot(2, "other")


@pytest.mark.parametrize("name", ["spells", "last", "codes"])
def test_what_a_file_lacks_is_named(name: str) -> None:
    arrays = EmpiricalSnapshot(2, "auto").arrays()
    del arrays[name]
    with pytest.raises(ValueError, match=f"^{name}: must be there"):
        EmpiricalSnapshot.from_arrays(arrays)
