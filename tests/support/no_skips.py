"""A pytest plugin: with NEUROSNAP_NO_SKIPS=1 a test that is skipped has failed.

A developer may lack a browser or a broker; what decides whether a change lands
must have looked at everything.
"""

import os
from collections.abc import Generator
from typing import TypeVar

import pytest

VARIABLE = "NEUROSNAP_NO_SKIPS"
_R = TypeVar("_R", pytest.TestReport, pytest.CollectReport)


def _refuse(report: _R) -> _R:
    if report.skipped and not hasattr(report, "wasxfail") and os.environ.get(VARIABLE):
        why = report.longrepr
        said = why[2] if isinstance(why, tuple) else str(why)
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid}: must not be skipped here: {said}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[
    None, pytest.TestReport, pytest.TestReport
]:
    """Let no test be skipped."""
    return _refuse((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[
    None, pytest.CollectReport, pytest.CollectReport
]:
    """Let no module be skipped."""
    return _refuse((yield))
