"""A run that does not fit this machine is refused, with the number that does."""

import pytest

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.runtime import preflight
from neurosnap.runtime.preflight import BYTES_A_CELL, BYTES_BESIDE

GB = 1_000_000_000


def machine(
    monkeypatch: pytest.MonkeyPatch, free: int, *limits: tuple[str, int, int]
) -> None:
    monkeypatch.setattr(preflight, "free_memory", lambda: free)
    monkeypatch.setattr(preflight, "process_limits", lambda: iter(limits))
    monkeypatch.setattr(preflight, "allow_files", lambda _: None)


def test_sensors_fit_as_long_as_all_their_pairs_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine(monkeypatch, BYTES_BESIDE + 12 * 1000**2)
    preflight.check_sensors(1000)
    rule = r"^sensors: must be at most 1,000 here: 12 bytes for every pair are 0\.0 GB,"
    with pytest.raises(InvalidValueError, match=rule):
        preflight.check_sensors(1001)


@pytest.mark.parametrize(
    ("free", "limits", "most", "rule"),
    [
        (
            BYTES_BESIDE + 100 * BYTES_A_CELL,
            [],
            100,
            r"^cells: must be at most 100 here: each takes 6 MB, free are 1\.2 GB"
            r" \(run fewer, or with --cells worker\), got 101$",
        ),
        (
            100 * GB,
            [("wide", 100_000, 0), ("tight", 1_000, 100)],
            96,
            r"^cells: must be at most 96 here: each takes 9 threads, tight leaves 900 ",
        ),
    ],
    ids=["memory", "threads"],
)
def test_the_tightest_limit_on_cells_counts(
    free: int,
    limits: list[tuple[str, int, int]],
    most: int,
    rule: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine(monkeypatch, free, *limits)
    preflight.check_cells(most)
    with pytest.raises(InvalidValueError, match=rule):
        preflight.check_cells(most + 1)


def test_what_may_be_open_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    machine(monkeypatch, 100 * GB)

    def refuse(children: int) -> None:
        raise SwarmError(f"open files: limit must be at least {3 * children}")

    monkeypatch.setattr(preflight, "allow_files", refuse)
    rule = r"^cells: must fit what may be open: open files: limit must be at least 42"
    with pytest.raises(InvalidValueError, match=rule):
        preflight.check_cells(10)
