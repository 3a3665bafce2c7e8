"""One wiring is lost between two waves, and nothing else: the run notices at once.

Each case is a function of its seed alone. What must come out is what the snapshot says
in process, which knows nothing of cells.
"""

import functools
import random
from collections.abc import Callable
from typing import NamedTuple

import pytest

from neurosnap import wire
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from tests.support.exhaustive import rows
from tests.support.simulated_swarm import (
    THRESHOLD,
    SimulatedSwarm,
    counting_swarm,
    repeatable,
)

pytestmark = pytest.mark.slow

CASES = 100
MOST = 1 << 16  # edges in a frame
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


class Case:
    """What is read, by a seed, and who hosts the cells."""

    def __init__(self, seed: int, *, shared: bool, frame: int) -> None:
        self.seed = seed
        self.frame = frame
        self.chance = random.Random(seed)
        self.rows = random_rows(self.chance)
        self.workers = self.chance.randint(1, len(self.rows[0])) if shared else 0
        self.expected = expected(self.rows)

    def run(self, *lost: Name) -> SimulatedSwarm:
        swarm = counting_swarm(
            self.rows, self.seed, self.workers, self.frame, without(*lost)
        )
        swarm.run()
        assert swarm.states() == self.expected
        assert swarm.core.totals.ticks == len(self.rows)
        return swarm


class OneLost(NamedTuple):
    """A run that has lost one wiring of those that were sent when nothing was lost."""

    case: Case
    sent: list[Name]
    lost: Name
    swarm: SimulatedSwarm


@functools.cache
def lose_one(seed: int, *, shared: bool, frame: int = MOST) -> OneLost | None:
    """Lose one wiring of a run; None: there is none."""
    case = Case(seed, shared=shared, frame=frame)
    undisturbed = case.run()
    assert undisturbed.repeats == 0
    sent = wirings(undisturbed.said)
    if not sent:
        return None
    lost = case.chance.choice(sent)
    return OneLost(case, sent, lost, case.run(lost))


@pytest.mark.parametrize(
    ("shared", "frame"), rows([(True, 1)], [(False, MOST), (True, MOST)])
)
def test_a_lost_wiring_changes_no_state(shared: bool, frame: int) -> None:
    noticed = 0
    for seed in range(CASES):
        with repeatable(seed):
            found = lose_one(seed, shared=shared, frame=frame)
            noticed += found is not None and found.swarm.repeats > 0
    assert noticed > CASES / 3


def lose_two(seed: int) -> bool:
    """Lose a wiring, and the last frame of the whole one that mends it."""
    once = lose_one(seed, shared=True, frame=1)
    if once is None:
        return False
    mending = [name for name in wirings(once.swarm.said) if name not in once.sent]
    if not mending:
        return False
    # The last for a worker: after one before, the next would tell it of a gap.
    more = once.case.chance.choice(list(dict(mending).items()))
    return once.case.run(once.lost, more).repeats > once.swarm.repeats


def test_a_lost_frame_of_a_whole_wiring_changes_no_state() -> None:
    """A repeat wires everybody anew; a part of that must not pass for all of it."""
    noticed = 0
    for seed in range(CASES):
        with repeatable(seed):
            noticed += lose_two(seed)
    assert noticed > CASES / 3
