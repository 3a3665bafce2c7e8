"""A grown sensor gets its weights from history; other weights do not change."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.history_questions import answered
from neurosnap.poc.learning.pairs import excluded
from neurosnap.poc.learning.reading_history import History, Newborn, conjunction
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.sensorium import Sensorium
from tests.support.hypothesis_settings import examples

Bits = NDArray[np.bool_]
Members = tuple[tuple[int, ...], tuple[int, ...]]
"""The literals of a conjunction: of its tick, and of the one before."""


def new(kind: str, names: tuple[str, ...]) -> Snapshot:
    if kind == "empirical":
        return EmpiricalSnapshot(Sensorium(names), 0.1)
    return DiscountedSnapshot(Sensorium(names), 0.1, 0.75)


def read(literal: int, bits: Bits, known: Bits) -> bool | None:
    """Return whether a literal was read; None: its sensor's reading is unknown."""
    if not known[literal >> 1]:
        return None
    return bool(bits[literal >> 1]) != bool(literal & 1)


def every(snapshot: Snapshot) -> NDArray[np.float64]:
    """Return the four weights of all pairs."""
    snapshot._settle()
    snapshot.stand_apart()
    blocks = snapshot._weights.blocks(snapshot._total())
    return np.concatenate([squares for _, squares in blocks], axis=1)


def joined(
    walk: tuple[Bits, Bits], members: Members, tick: int, first: int
) -> tuple[bool, bool]:
    """Return what a conjunction reads, and whether that is known.

    Of the tick before the first nothing is known.
    """
    bits, known = walk
    now, last = members
    each = [read(literal, bits[tick], known[tick]) for literal in now]
    if tick > first:
        each += [read(a, bits[tick - 1], known[tick - 1]) for a in last]
    else:
        each += [None for _ in last]
    if any(one is False for one in each):
        return False, True
    return (True, True) if all(each) else (False, False)


@st.composite
def walks(draw: st.DrawFn) -> tuple[Bits, Bits, Members, int]:
    """Draw readings, which are known, the members of a sensor, and when it is grown."""
    count, ticks = draw(st.integers(2, 5)), draw(st.integers(1, 150))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    bits = rng.random((ticks, count)) < rng.random(count)
    whole = draw(st.booleans())
    known = np.ones_like(bits) if whole else rng.random((ticks, count)) < 0.8
    now, last = (
        tuple(
            sorted(
                2 * sensor + draw(st.integers(0, 1))
                for sensor in draw(st.permutations(range(count)))[:size]
            )
        )
        for size in (draw(st.integers(1, count)), draw(st.integers(0, 2)))
    )
    return bits, known, (now, last), draw(st.integers(1, ticks))


def newborn_of(
    snapshot: Snapshot,
    history: History,
    members: Members,
    unread: Sequence[int] = (),
) -> Newborn:
    """Return what a history makes of the conjunction of some literals."""
    sensor = len(snapshot.sensorium) - 1
    read = {literal: history.ticks_of(literal) for literal in range(2 * sensor)}
    rings = conjunction(read, *members, history.tick)
    history.on[:, sensor], history.off[:, sensor] = rings
    search = snapshot.newborn(sensor, history.ticks, *rings, unread)
    return answered(search, history.answer)


@examples(60)
@given(walks())
def test_it_is_as_if_it_had_been_there_as_long_as_the_history_goes_back(
    walk: tuple[Bits, Bits, Members, int],
) -> None:
    bits, known, members, birth = walk
    names = Sensorium.of(bits.shape[1]).names
    grown, always = new("empirical", (*names, "x")), new("empirical", (*names, "new"))
    count, history = len(names), History(len(names) + 1, 64)
    unread = np.zeros(1, np.bool_)
    began = max(0, birth - 64)
    for tick in range(len(bits)):
        extra = joined((bits, known), members, tick, began)
        more = np.append(bits[tick], extra[0]), np.append(known[tick], extra[1])
        if tick >= birth:
            grown.observe(*more)
        else:
            nothing = np.append(bits[tick], unread), np.append(known[tick], unread)
            grown.observe(*nothing)
            history.record(*nothing)
        if tick >= began:
            always.observe(*more)
        if tick + 1 == birth:
            newborn = newborn_of(grown, history, members)
            grown.grow(count, "new", newborn, None)
    assert grown.sensorium == always.sensorium
    if began:  # Of the others it knows more than that.
        squares, expected = every(grown)[:, -count:], every(always)[:, -count:]
        np.testing.assert_allclose(squares, expected, atol=1e-12)
        return
    np.testing.assert_allclose(every(grown), every(always), atol=1e-12)
    assert grown.poc_graph().edges.tolist() == always.poc_graph().edges.tolist()
    if birth < len(bits):
        assert grown.state.tolist() == always.state.tolist()


@given(walks())
def test_a_discounted_one_starts_with_the_shares_of_the_history(
    walk: tuple[Bits, Bits, Members, int],
) -> None:
    bits, known, members, birth = walk
    count, history = bits.shape[1], History(bits.shape[1] + 1, 64)
    began, counts = max(0, birth - 64), np.zeros((4, bits.shape[1]))
    for tick in range(birth):
        more = np.append(bits[tick], False), np.append(known[tick], False)
        history.record(*more)
        if tick >= began:
            on, sure = joined((bits, known), members, tick, began)
            counts[2 * (not on) + ~bits[tick], np.arange(count)] += sure & known[tick]
    snapshot = new("discounted", (*Sensorium.of(count).names, "free"))
    _, squares, codes = newborn_of(snapshot, history, members)
    total = counts.sum(axis=0)
    shares = np.where(total, counts / np.maximum(total, 1), 0.25)
    least, second, *_ = np.sort(shares, axis=0)
    equal = ((shares[[1, 0]] == 0) & (shares[[2, 3]] == 0)).any(axis=0)
    strict = (least < second) & (least < 0.1) & ~equal
    assert np.isin(codes, (1, 2, 4, 8)).tolist() == strict.tolist()
    assert np.isin(codes, (3, 12)).tolist() == equal.tolist()
    # Truncation takes what is against an implication, and keeps the marginals.
    np.testing.assert_allclose(excluded(codes, squares), 0, atol=1e-12)
    for pair in ([0, 1], [2, 3], [0, 2]):
        expected = shares[pair].sum(axis=0)
        np.testing.assert_allclose(squares[pair].sum(axis=0), expected, atol=1e-12)
    np.testing.assert_array_equal(squares[:, codes == 0], shares[:, codes == 0])


@pytest.mark.parametrize("kind", ["empirical", "discounted"])
@given(walks())
def test_what_was_there_is_as_it_was(
    kind: str, walk: tuple[Bits, Bits, Members, int]
) -> None:
    bits, known, members, birth = walk
    reads = (None, False, True)[birth % 3]
    count = bits.shape[1]
    snapshot = new(kind, (*Sensorium.of(count).names, "free"))
    history = History(count + 1, 64)
    for tick in range(birth):
        more = np.append(bits[tick], False), np.append(known[tick], False)
        snapshot.observe(*more)
        history.record(*more)
    before = Snapshot.from_bytes(snapshot.to_bytes())
    old = range(2 * count)
    pairs = [(a, b) for a in old for b in old if a >> 1 != b >> 1]
    snapshot.grow(count, "new", newborn_of(snapshot, history, members), reads)
    assert snapshot.state[-2:].tolist() == [reads is True, reads is False]
    assert snapshot.sensorium.names[-1] == "new"
    for a, b in pairs:
        assert snapshot.weight(a, b) == before.weight(a, b)
    inside = np.ix_(old, old)
    edges = snapshot.poc_graph().edges
    assert edges[inside].tolist() == before.poc_graph().edges[inside].tolist()
    assert snapshot.state[old].tolist() == before.state[old].tolist()
    again = Snapshot.from_bytes(snapshot.to_bytes())
    assert again.to_bytes() == snapshot.to_bytes()
    assert again.poc_graph().edges.tolist() == edges.tolist()

    snapshot.silence(count)
    assert not snapshot.poc_graph().edges[-2:].any()
    assert not snapshot.state[-2:].any()
    assert snapshot.poc_graph().edges.tolist() == before.poc_graph().edges.tolist()


@pytest.mark.parametrize("kind", ["empirical", "discounted"])
def test_what_is_not_read_any_more_stays_out_of_the_order(kind: str) -> None:
    snapshot, history = new(kind, ("a", "b", "gone", "free")), History(4, 64)
    rng = np.random.default_rng(5)
    for _ in range(60):
        a, b = rng.random(2) < 0.5
        bits, known = np.array([a, b, a, False]), np.array([True] * 3 + [False])
        snapshot.observe(bits, known)
        history.record(bits, known)
    snapshot.silence(2)
    members = (0, 2), ()
    snapshot.grow(3, "new", newborn_of(snapshot, history, members, [2]), None)
    edges = snapshot.poc_graph().edges
    assert not edges[4:6].any()
    assert not edges[:, 4:6].any()
    assert edges[6, 0]
    # Else what it read once would tell of it.
    assert newborn_of(snapshot, history, members).codes[2]
    assert snapshot.weight(4, 6) == snapshot.weight(5, 7)


def test_a_history_keeps_the_last_ticks_in_order() -> None:
    history, rng = History(3, 64), np.random.default_rng(1)
    bits, known = rng.random((200, 3)) < 0.5, rng.random((200, 3)) < 0.7
    for tick in range(200):
        history.record(bits[tick], known[tick])
        first = max(0, tick - 63)
        kept = np.arange(first, tick + 1)
        for ring, flags in (history.on, bits & known), (history.off, ~bits & known):
            read = ring >> (kept % 64).astype(np.uint64)[:, np.newaxis] & np.uint64(1)
            assert read.astype(np.bool_).tolist() == flags[kept].tolist()
    again = History.from_arrays(history.arrays(), 3, history.length)
    assert again.ticks == history.ticks == 64
    assert again.on.tolist() == history.on.tolist()


def test_what_cannot_be_grown_is_refused() -> None:
    snapshot, history = EmpiricalSnapshot(3, 0.1), History(3, 64)
    newborn = newborn_of(snapshot, history, ((0,), ()))
    nothing = history.ticks, history.on[:, 0], history.off[:, 0]
    with pytest.raises(InvalidValueError, match="must be unique"):
        snapshot.grow(2, "s0", newborn, None)
    with pytest.raises(ShapeError, match="newborn: must be of 1 pairs, got"):
        snapshot.grow(1, "new", newborn, None)
    with pytest.raises(InvalidValueError, match=r"literal: must be a literal.* got 6"):
        answered(snapshot.newborn(3, *nothing), history.answer)
    with pytest.raises(ValueError, match=r"on: must be uint64 \(0, 3\)"):
        History.from_arrays(History(4, 64).arrays(), 3, 64)
    with pytest.raises(InvalidValueError, match="history: must be a multiple of 64"):
        History(2, 100)
    assert snapshot.sensorium.names == ("s0", "s1", "s2")
    assert not history.on.any()
