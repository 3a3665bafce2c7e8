"""How often a run may go on: so many times within so many seconds."""

from msgspec import convert

from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.runtime.request import Supervision
from neurosnap.runtime.run import Restarts

DIED = PartDiedError("cell/1: was killed")


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_restarts_count_only_for_a_while() -> None:
    clock = Clock()
    restarts = Restarts(Supervision(max_restarts=2, restart_window=60.0), clock)
    assert [restarts.allow(DIED) for _ in range(3)] == [True, True, False]
    clock.now += 59.0
    assert not restarts.allow(DIED)
    clock.now += 1.0
    assert [restarts.allow(DIED) for _ in range(3)] == [True, True, False]


def test_a_run_of_months_goes_on_after_any_number_of_faults() -> None:
    clock = Clock()
    restarts = Restarts(Supervision(), clock)
    for _ in range(1000):
        clock.now += 100.0
        assert restarts.allow(DIED)


def test_none_may_be_allowed() -> None:
    assert not Restarts(Supervision(max_restarts=0)).allow(DIED)


def test_which_errors_are_mended_is_the_policys_to_say() -> None:
    said = SwarmError("world: the source is gone")
    for kind, mended in (
        ("never", []),
        ("on-failure", [DIED]),
        ("always", [DIED, said]),
    ):
        restarts = Restarts(convert({"restart": kind}, Supervision))
        assert [error for error in (DIED, said) if restarts.allow(error)] == mended


def test_without_a_tick_in_between_each_delay_is_twice_the_last() -> None:
    restarts = Restarts(Supervision(backoff=1.0))
    assert [restarts.delay(gained=False) for _ in range(6)] == [2, 4, 8, 16, 30, 30]
    assert restarts.delay(gained=True) == 1
    assert restarts.delay(gained=False) == 2
