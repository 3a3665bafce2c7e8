"""A test is skipped if its program is missing, unless skips are forbidden."""

import pytest

from tests.support.no_skips import VARIABLE

LACKING = """
from tests.support.programs import needs

@needs("no-such-program", "no-such-package")
def test_that_needs_it():
    raise AssertionError

@needs("sh")
def test_that_needs_a_shell():
    pass
"""
LACKING_MODULE = """
import pytest

pytest.importorskip("no_such_module")
"""
WHY = "needs no-such-program: apt-get install no-such-package"


def outcome(
    pytester: pytest.Pytester, text: str, said: str | None = None
) -> dict[str, int]:
    """Run a module of tests as this one is run; return how many came to what."""
    pytester.makepyfile(text)
    pytester.makeini("[pytest]\nasyncio_default_fixture_loop_scope = function")
    result = pytester.runpytest_inprocess("-p", "tests.support.no_skips", "-rs")
    if said is not None:
        result.stdout.fnmatch_lines([f"*{said}*"])
    found: dict[str, int] = result.parseoutcomes()
    return found


def test_a_test_without_its_program_is_skipped_with_the_name_of_it(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert outcome(pytester, LACKING, WHY) == {"passed": 1, "skipped": 1}
    assert outcome(pytester, LACKING_MODULE)["skipped"] == 1


def test_where_none_may_be_skipped_it_has_failed_and_so_has_a_module(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "1")
    said = f"must not be skipped here: Skipped: {WHY}"
    assert outcome(pytester, LACKING, said) == {"passed": 1, "errors": 1}
    assert outcome(pytester, LACKING_MODULE, "must not be skipped") == {"errors": 1}
