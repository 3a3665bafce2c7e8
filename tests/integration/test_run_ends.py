"""Runs end in order on a signal, at any moment."""

import contextlib
import signal
from collections.abc import Callable

import pytest

from tests.support.exhaustive import rows
from tools.soak.signals import Struggle, struggling

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_process_is_left")]
INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
ENDLESS = ("--ticks", 10_000_000, "--set", "places=4")


def under_way(run: Struggle) -> bool:
    return size_of(run) > 30_000


def size_of(run: Struggle) -> int:
    """Return the size of its recording, which a restart may have moved just now."""
    with contextlib.suppress(FileNotFoundError):
        return run.log.stat().st_size
    return 0


def restarting(run: Struggle) -> bool:
    if "going on" in run.said():
        return True
    parts = run.parts()
    if under_way(run) and "cell/2" in parts:
        parts["cell/2"].kill()
    return False


MOMENTS: dict[str, Callable[[Struggle], bool]] = {
    "at the start": Struggle.hears,
    "with the hub": lambda run: "hub" in run.parts(),
    "with the recorder": lambda run: run.log.exists(),
    "with a cell": lambda run: "cell/0" in run.parts(),
    "under way": under_way,
    "in a restart": restarting,
}


@pytest.mark.parametrize(
    ("moment", "number", "group"),
    rows(
        [
            ("at the start", INT, True),
            ("with a cell", TERM, True),
            ("under way", HUP, False),
            ("in a restart", INT, True),
        ],
        [("with the hub", INT, True), ("with the recorder", TERM, True)],
    ),
    ids=str,
)
def test_a_signal_ends_a_run_in_order_at_any_moment(
    moment: str, number: signal.Signals, group: bool
) -> None:
    with struggling(*ENDLESS, "--set", "supervision.backoff=1") as run:
        run.wait_until(lambda: MOMENTS[moment](run))
        run.strike(number, group=group)
        found = run.judge()
    assert found.wrong == []
    if moment == "at the start":
        assert (found.code, found.lines) == (130, ["interrupted"])
    else:
        assert found.code == 0


def test_a_second_signal_while_it_ends_changes_nothing() -> None:
    with struggling(*ENDLESS) as run:
        run.wait_until(lambda: under_way(run))
        run.strike(TERM, group=True)
        run.wait_until(lambda: "coordinator" not in run.parts())
        run.strike(TERM, group=True)
        found = run.judge()
    assert (found.code, found.wrong) == (0, [])


def test_what_is_run_under_nohup_outlives_its_terminal() -> None:
    with struggling(*ENDLESS, ignoring=HUP) as run:
        run.wait_until(lambda: under_way(run))
        run.strike(HUP, group=True)
        size = size_of(run)
        run.wait_until(lambda: size_of(run) > 2 * size)
        assert run.process.poll() is None
        run.strike(TERM, group=True)
        found = run.judge()
    assert (found.code, found.wrong) == (0, [])
