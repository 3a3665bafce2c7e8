"""How often a run may go on: so many times within so many seconds."""

from neurosnap.runtime.restart_policy import Restarts, Supervision


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_restarts_count_only_for_a_while() -> None:
    clock = Clock()
    restarts = Restarts(Supervision(max_restarts=2, restart_window=60.0), clock)
    assert [restarts.allow() for _ in range(3)] == [True, True, False]
    clock.now += 59.0
    assert not restarts.allow()
    clock.now += 1.0
    assert [restarts.allow() for _ in range(3)] == [True, True, False]


def test_a_run_of_months_goes_on_after_any_number_of_faults() -> None:
    clock = Clock()
    restarts = Restarts(Supervision(), clock)
    for _ in range(1000):
        clock.now += 100.0
        assert restarts.allow()


def test_none_may_be_allowed() -> None:
    assert not Restarts(Supervision(max_restarts=0)).allow()
