"""A pytest plugin that measures the processor time of tests, and prints the longest.

The processor time of a test is that of its process, of the children that it waited for,
and of all that the fork server started, between the end of the test before and its own
end: so the fixtures of a module count for the first test that uses them. It says what
a test costs on any machine, busy or not; how long it took does not.
"""

import os
import resource
from collections.abc import Generator, Iterable
from contextlib import suppress
from multiprocessing import forkserver
from pathlib import Path

import pytest

LONGEST = 25
"""How many tests are printed."""
LIMIT = 1.0
"""Seconds that a test may cost that is neither slow nor exhaustive."""
QUICK = 0.05
"""Seconds that a test of `make quick` may cost in the mean."""
_COST, _KIND = "processor time", "kind of test"
_TICK = 1 / os.sysconf("SC_CLK_TCK")


def _spent() -> float:
    """Return the seconds spent by this process, its children and the fork server."""
    own = resource.getrusage(resource.RUSAGE_SELF)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime
    server = vars(forkserver.__dict__["_forkserver"])["_forkserver_pid"]
    if server is not None:
        with suppress(FileNotFoundError):  # it has ended, and is among the children
            # Its own seconds and those of its children, which include their children.
            # Behind the name, which may hold spaces: the 14th to the 17th field.
            stat = Path(f"/proc/{server}/stat").read_text().rpartition(")")[2]
            spent += sum(map(int, stat.split()[11:15])) * _TICK
    return spent


class ProcessorTime:
    """Notes what each test cost, in the worker; adds it up, where the report is."""

    def __init__(self) -> None:
        self._before = 0.0
        self._costs: dict[str, float] = {}
        self._kinds: dict[str, str] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self) -> Generator[None, object, object]:
        """Take the time before a test begins."""
        self._before = _spent()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Add the time to the report of the teardown, the last of a test."""
        report = yield
        if call.when == "teardown":
            cost = (_COST, _spent() - self._before)
            report.user_properties += [cost, (_KIND, _kind(item))]
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect the times, which come from the workers."""
        said = dict(report.user_properties)
        if isinstance(cost := said.get(_COST), float):
            self._costs[report.nodeid] = cost
            self._kinds[report.nodeid] = str(said[_KIND])

    def pytest_terminal_summary(
        self, terminalreporter: pytest.TerminalReporter
    ) -> None:
        """Print the tests that cost most, and all of them to a file if one is named."""
        rows = sorted(self._costs.items(), key=lambda row: -row[1])
        if path := os.environ.get("NEUROSNAP_TEST_COSTS"):
            lines = [f"{cost:.3f} {name}\n" for name, cost in rows]
            Path(path).write_text("".join(lines), encoding="utf-8")
        total = sum(self._costs.values())
        terminalreporter.section(f"processor time: {total:.0f} s, the longest of it")
        for name, cost in rows[:LONGEST]:
            terminalreporter.line(f"{cost:8.2f} s  {name}")
        for line in self._beyond(rows):
            terminalreporter.line(line)

    def _beyond(self, rows: Iterable[tuple[str, float]]) -> Iterable[str]:
        """Yield which limits are exceeded. No test fails for it: machines differ."""
        quick = [cost for name, cost in rows if self._kinds[name] == "quick"]
        for name, cost in rows:
            if cost > LIMIT and self._kinds[name] != "slow":
                yield f"more than {LIMIT:.0f} s, and not marked as slow: {name}"
        if quick and (mean := sum(quick) / len(quick)) > QUICK:
            yield f"a test of `make quick` costs {mean:.3f} s, more than {QUICK} s"


def _kind(item: pytest.Item) -> str:
    """Return whether a test is slow, one of `make quick`, or another."""
    if any(item.get_closest_marker(mark) for mark in ("slow", "exhaustive")):
        return "slow"
    folders = ("tests/unit/", "tests/property/", "tests/golden/")
    quick = item.nodeid.startswith(folders) and not item.get_closest_marker("zenoh")
    return "quick" if quick else "other"


def pytest_configure(config: pytest.Config) -> None:
    """Let the plugin take part."""
    config.pluginmanager.register(ProcessorTime(), "processor-time")
