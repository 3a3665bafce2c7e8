"""One wiring is lost between two waves, and nothing else: the run notices at once.

Each case is a function of its seed alone. What must come out is what the snapshot says
in process, which knows nothing of cells.
"""

import random
from collections.abc import Callable

import pytest

from neurosnap import wire
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from tests.support.simulated_swarm import THRESHOLD, counting_swarm, repeatable

pytestmark = pytest.mark.slow

CASES = 100
Rows = list[list[bool]]
Name = tuple[str, int]


def wirings(messages: list[wire.Message]) -> list[Name]:
    """Name each wiring: whose it is, and its epoch."""
    return [
        (message.key, message.epoch)
        for message in messages
        if isinstance(message, wire.Wiring | wire.WorkerWiring)
    ]


def without(*lost: Name) -> Callable[[str, wire.Message], bool]:
    """Return who is deaf to what, where these wirings are lost."""
    return lambda _who, message: not {*wirings([message])}.isdisjoint(lost)


def random_rows(chance: random.Random) -> Rows:
    """Draw readings that repeat themselves, so that much is learned and then broken."""
    sensors = chance.randint(2, 6)
    pool = [[chance.random() < 0.5 for _ in range(sensors)] for _ in range(4)]
    return [list(chance.choice(pool)) for _ in range(chance.randint(8, 16))]


def expected(rows: Rows) -> list[list[bool]]:
    snapshot = EmpiricalSnapshot(len(rows[0]), threshold=THRESHOLD)
    return [snapshot.observe(row).tolist() for row in rows]


def lose_one(seed: int, *, shared: bool, frame: int = 1 << 16) -> bool:
    """Lose one wiring of a run; tell whether any wave had to be repeated for it."""
    chance = random.Random(seed)
    rows = random_rows(chance)
    workers = chance.randint(1, len(rows[0])) if shared else 0
    undisturbed = counting_swarm(rows, seed, workers, frame)
    undisturbed.run()
    assert undisturbed.states() == expected(rows)
    assert undisturbed.repeats == 0
    sent = wirings(undisturbed.said)
    if not sent:
        return False
    swarm = counting_swarm(rows, seed, workers, frame, without(chance.choice(sent)))
    swarm.run()
    assert swarm.states() == expected(rows)
    assert swarm.core.totals.ticks == len(rows)
    return swarm.repeats > 0


@pytest.mark.parametrize("shared", [False, True])
def test_a_lost_wiring_changes_no_state(shared: bool) -> None:
    noticed = 0
    for seed in range(CASES):
        with repeatable(seed):
            noticed += lose_one(seed, shared=shared)
    assert noticed > CASES / 3


def test_a_lost_frame_of_many_changes_no_state() -> None:
    noticed = 0
    for seed in range(CASES):
        with repeatable(seed):
            noticed += lose_one(seed, shared=True, frame=1)
    assert noticed > CASES / 3


def lose_two(seed: int) -> bool:
    """Lose a wiring, and the last frame of the whole one that mends it."""
    chance = random.Random(seed)
    rows = random_rows(chance)
    workers = chance.randint(1, len(rows[0]))
    undisturbed = counting_swarm(rows, seed, workers, frame=1)
    undisturbed.run()
    sent = wirings(undisturbed.said)
    lost = sent and [chance.choice(sent)]
    once = counting_swarm(rows, seed, workers, 1, without(*lost))
    once.run()
    mending = [name for name in wirings(once.said) if name not in sent]
    if not mending:
        return False
    # The last for a worker: after one before, the next would tell it of a gap.
    lost = [*lost, chance.choice(list(dict(mending).items()))]
    twice = counting_swarm(rows, seed, workers, 1, without(*lost))
    twice.run()
    assert twice.states() == expected(rows)
    return twice.repeats > once.repeats


def test_a_lost_frame_of_a_whole_wiring_changes_no_state() -> None:
    """A repeat wires everybody anew; a part of that must not pass for all of it."""
    noticed = 0
    for seed in range(CASES):
        with repeatable(seed):
            noticed += lose_two(seed)
    assert noticed > CASES / 3
