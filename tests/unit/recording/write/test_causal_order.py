"""Replies are written after what they answer, and each sender's order is kept."""

import random
from collections.abc import Iterable

from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.recording.write.causal_order import Arrival, CausalOrder
from tests.support.hypothesis_settings import examples

PATIENCE = 10


def heard(messages: Iterable[wire.Message]) -> list[Arrival]:
    """Number the messages of each sender."""
    numbers: dict[str, int] = {}
    found: list[Arrival] = []
    for message in messages:
        number = numbers.get(message.sender, 0)
        numbers[message.sender] = number + 1
        delivery = wire.Delivery(message.key, number, 0, wire.encode(message))
        found.append(Arrival(message, delivery, len(found)))
    return found


def settled(wave: int, cell: int = 0) -> wire.CellReport:
    return wire.CellReport(wave, cell, 0, (), (), (0,), 0)


def start(wave: int) -> wire.WaveStart:
    return wire.WaveStart(wave, wave, "state", 0, wave)


def decision(tick: int) -> wire.Decision:
    return wire.Decision(tick, -1, "")


def run(ticks: int) -> list[Arrival]:
    """A run in the order in which it was said."""
    said: list[wire.Message] = [decision(0)]
    for tick in range(1, ticks + 1):
        said += [wire.Observation(tick, b"\0"), start(tick)]
        said += [wire.Fault("cell/1", "odd"), settled(tick, 1), settled(tick, 0)]
        said += [wire.KeyFrame(tick, b""), decision(tick)]
    return heard(said)


@given(st.integers(0, 2**32), st.integers(1, 8), st.integers(0, 60))
@examples(60)
def test_whoever_overtakes_whom_causes_come_first(
    seed: int, ticks: int, reach: int
) -> None:
    chance, due = random.Random(seed), dict[str, float]()
    said, keyed = run(ticks), []
    for place, one in enumerate(said):
        who = one.message.sender
        due[who] = max(due.get(who, 0.0), place + chance.random() * reach)
        keyed.append((due[who], place, one))
    causes, came = CausalOrder(PATIENCE), list[Arrival]()
    for _, _, one in sorted(keyed, key=lambda entry: entry[:2]):
        came += causes.add(one)
    assert causes.rest() == []
    assert sorted(came, key=lambda one: one.log_time) == said
    places = {
        (one.message.sender, one.delivery.sequence): n for n, one in enumerate(came)
    }
    for who in due:
        own = [one.delivery.sequence for one in came if one.message.sender == who]
        assert own == list(range(len(own)))
    starts, asked = {}, {}
    for one in came:
        at = places[one.message.sender, one.delivery.sequence]
        match one.message:
            case wire.WaveStart(wave=wave):
                starts[wave] = at
            case wire.Decision(tick=tick):
                asked[tick + 1] = at
            case wire.CellReport(wave=wave):
                assert at > starts[wave]
            case wire.Observation(tick=tick):
                assert at > asked[tick]
            case _:
                pass


def test_what_is_in_order_does_not_wait() -> None:
    causes = CausalOrder(PATIENCE)
    for one in run(3):
        assert list(causes.add(one)) == [one]


def test_a_lost_word_is_not_waited_for_behind_the_next() -> None:
    causes = CausalOrder(PATIENCE)
    early, next_start = heard([settled(1), start(2)])
    assert list(causes.add(early)) == []
    assert (causes.upcoming("cell/0"), causes.upcoming("cell/1")) == (1, 0)
    assert list(causes.add(next_start)) == [next_start, early]
    assert causes.upcoming("cell/0") == 0


def test_a_word_that_does_not_come_is_not_waited_for_for_ever() -> None:
    causes = CausalOrder(PATIENCE)
    far, behind, other = heard([settled(9), wire.Fault("cell/0", "odd"), settled(9, 1)])
    for one in (far, behind, other):
        assert list(causes.add(one)) == []
    assert (causes.upcoming("cell/0"), causes.upcoming("cell/1")) == (2, 1)
    assert list(causes.due(far.log_time + PATIENCE)) == []
    assert list(causes.due(far.log_time + PATIENCE + 1)) == [far, behind]
    assert list(causes.due(other.log_time + PATIENCE + 1)) == [other]
    assert causes.rest() == []


def test_a_clock_that_was_set_back_lets_nobody_overtake_himself() -> None:
    causes = CausalOrder(PATIENCE)
    first, second = heard([settled(9), settled(9)])
    later = first._replace(log_time=1000)
    assert list(causes.add(later)) == []
    assert list(causes.add(second)) == []
    assert list(causes.due(500)) == []
    assert list(causes.due(1000 + PATIENCE + 1)) == [later, second]
