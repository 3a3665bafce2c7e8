"""A pytest plugin that measures the processor time of tests, and prints the longest.

The processor time of a test is that of its process and of the children that it waited
for, between the end of the test before and its own end: so the fixtures of a module
count for the first test that uses them. It says what a test costs on any machine, busy
or not; how long it took does not.
"""

import os
import resource
from collections.abc import Generator
from pathlib import Path

import pytest

MOST = 25
"""How many tests are printed."""

_NAME = "processor time"


def _spent() -> float:
    """Return the seconds spent by this process and the children it waited for."""
    own = resource.getrusage(resource.RUSAGE_SELF)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


class ProcessorTime:
    """Notes what each test cost, in the worker; adds it up, where the report is."""

    def __init__(self) -> None:
        self._before = 0.0
        self._costs: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self) -> Generator[None, object, object]:
        """Take the time before a test begins."""
        self._before = _spent()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Add the time to the report of the teardown, the last of a test."""
        report = yield
        if call.when == "teardown":
            report.user_properties.append((_NAME, _spent() - self._before))
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect the times, which come from the workers."""
        for name, value in report.user_properties:
            if name == _NAME and isinstance(value, float):
                self._costs[report.nodeid] = value

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
        for name, cost in rows[:MOST]:
            terminalreporter.line(f"{cost:8.2f} s  {name}")


def pytest_configure(config: pytest.Config) -> None:
    """Let the plugin take part."""
    config.pluginmanager.register(ProcessorTime(), "processor-time")
