"""Every row of the benchmarks runs."""

import json
import math

import pytest

from tests.support.mosquitto import needs_mosquitto
from tools.bench import __main__ as bench
from tools.browser import NO_BROWSER, chromium

pytestmark = [pytest.mark.bench, pytest.mark.slow, pytest.mark.zenoh]
needs_browser = pytest.mark.skipif(chromium() is None, reason=NO_BROWSER)


@pytest.mark.parametrize(
    "row",
    [
        pytest.param(
            name,
            marks=[
                *([] if name == "observe" else [pytest.mark.exhaustive]),
                *([needs_browser] if name in ("page", "seek") else []),
                *([needs_mosquitto] if name == "mqtt" else []),
            ],
        )
        for name in bench.ROWS
    ],
)
def test_a_row_runs(row: str, capsys: pytest.CaptureFixture[str]) -> None:
    bench.main(["--quick", "--only", row, "--json"])
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert list(report["rows"]) == [row]
    for line in report["rows"][row]:
        assert line["figures"], line["measured"]
        assert all(math.isfinite(figure) for figure in line["figures"].values())


def test_a_row_that_cannot_be_measured_says_why_and_the_others_stand(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CHROMIUM", raising=False)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(bench.ROWS, "hop", ("no_such_module", ""))
    bench.main(["--quick", "--only", "hop", "observe", "page", "--json"])
    _, _, hop, *observe, page, last = capsys.readouterr().out.splitlines()
    assert hop.startswith("| hop | not measured: No module named ")
    why = "not measured: needs chromium: apt-get install chromium-headless-shell"
    assert page.startswith(f"| page | {why} |")
    assert [line["figures"] for line in json.loads(last)["rows"]["page"]] == [{}]
    assert len(observe) == 6
    assert not any("not measured" in line for line in observe)
