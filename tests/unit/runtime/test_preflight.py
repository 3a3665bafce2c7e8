"""A run too large for this machine is refused, with the largest size that fits."""

import os
import resource
from types import SimpleNamespace

import psutil
import pytest

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.runtime import preflight
from neurosnap.runtime.child_processes import allow_files
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


GROUP = {"pids.max": "500", "pids.current": "90"}
BUSY = {"pid_max": "32768", "loadavg": "0.1 0.1 0.1 1/30000 77"}


@pytest.mark.parametrize(
    ("kernel", "user", "limit"),
    [
        ({}, 1000, ("the user's process limit (`ulimit -u`)", 4096, 0)),
        (BUSY, 0, ("kernel.pid_max (sysctl)", 32768, 30000)),
        (
            {"cgroup": "0::/user/job", **GROUP},
            0,
            ("/sys/fs/cgroup/user/job/pids.max", 500, 90),
        ),
        (
            {"cgroup": "7:pids:/user/job", **GROUP},
            0,
            ("/sys/fs/cgroup/pids/user/job/pids.max", 500, 90),
        ),
        ({"cgroup": "0::/", "pids.max": "max"}, 0, None),
    ],
)
def test_limits_are_those_that_are_set(
    kernel: dict[str, str],
    user: int,
    limit: tuple[str, int, int] | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(preflight, "_read", lambda path: kernel.get(path.name, ""))
    monkeypatch.setattr(os, "geteuid", lambda: user)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (4096, 4096))
    assert next(preflight.process_limits(), None) == limit


def test_the_memory_of_a_control_group_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = {"cgroup": "0::/", "memory.max": "200", "memory.current": "150"}
    monkeypatch.setattr(preflight, "_read", lambda path: kernel.get(path.name, ""))
    free = SimpleNamespace(available=GB)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: free)
    assert preflight.free_memory() == 50


@pytest.mark.parametrize(
    ("hard", "fits"), [(1024, False), (resource.RLIM_INFINITY, True)]
)
def test_what_may_be_open_is_raised_if_the_system_allows(
    hard: int, fits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (256, hard))
    monkeypatch.setattr(resource, "setrlimit", lambda _, to: limits.append(to))
    if not fits:
        with pytest.raises(SwarmError, match=r"limit must be at least .* got 1024"):
            allow_files(1000)
    else:
        allow_files(1000)
        assert limits[0][0] >= 1000
    assert bool(limits) == fits
