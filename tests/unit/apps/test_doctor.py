"""The doctor: what each check says when something is wrong, and when all is well."""

import importlib
import importlib.metadata
import os
import resource
import socket
import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import psutil
import pytest

from neurosnap.apps import doctor
from neurosnap.apps.doctor import Finding, examine
from neurosnap.runtime import preflight

Check = Callable[[], list[Finding]]
Patch = Callable[[pytest.MonkeyPatch], None]


def only(check: Check) -> Finding:
    """The one finding of a check."""
    (finding,) = check()
    return finding


def failing(error: Exception) -> Callable[..., Any]:
    def fail(*_: object, **__: object) -> Any:
        raise error

    return fail


def package(name: str) -> Finding:
    (finding,) = (f for f in doctor.check_packages() if name in f.what.split())
    return finding


def require(line: str, there: str = "") -> Patch:
    """Have one package required, of which a version is there."""

    def patch(to: pytest.MonkeyPatch) -> None:
        to.setattr(importlib.metadata, "requires", lambda _: [line])
        if there:
            to.setattr(importlib.metadata, "version", lambda _: there)

    return patch


def be(what: object, name: str, value: object) -> Patch:
    return lambda to: to.setattr(what, name, value)


def files(**texts: str) -> Patch:
    """Let files of the kernel's, by their names, say `texts`; others nothing."""
    return be(preflight, "_read", lambda path: texts.get(path.name, ""))


def user(number: int) -> Patch:
    return be(os, "geteuid", lambda: number)


def limit(soft: int, hard: int) -> Patch:
    return be(resource, "getrlimit", lambda _: (soft, hard))


def child(error: Exception) -> Patch:
    return be(subprocess, "run", failing(error))


def ended(code: int, said: str) -> Patch:
    done = subprocess.CompletedProcess("x", code, stdout="", stderr=said)
    return be(subprocess, "run", lambda *_, **__: done)


class Unbindable(socket.socket):
    bind = failing(OSError("cannot assign"))


def memory(available: int) -> Patch:
    free = SimpleNamespace(available=available)
    return be(psutil, "virtual_memory", lambda: free)


NEEDED = "no-such-thing>=2.1"
INSTALL = 'Run `python -m pip install "no-such-thing>=2.1"`.'
GROUP = {"pids.max": "500", "pids.current": "90"}
MEMORY = {"memory.max": "2000000000", "memory.current": "1500000000"}
UNLIMITED = resource.RLIM_INFINITY
NO_FILE = failing(OSError("read-only file system"))
SILENT = subprocess.TimeoutExpired("x", 20)
NAMED = partial(package, "no-such-thing")
OLD = partial(package, "msgspec")
ROWS: list[tuple[str, list[Patch], Callable[[], Finding], bool, str, str]] = [
    # What is wrong, where it is looked for, whether it will do, and what is said.
    ("missing package", [require(NEEDED)], NAMED, False, "not installed", INSTALL),
    ("missing extra", [require(f'{NEEDED}; extra == "plot"')], NAMED, True,
     "not installed", INSTALL),
    ("too old", [require("msgspec>=1.10", "1.9.9")], OLD, False,
     "1.9.9, older than 1.10", "msgspec>=1.10"),
    ("a candidate will do", [require("msgspec>=1.10", "1.10rc1")], OLD, True,
     "1.10rc1", ""),
    ("newer", [require("msgspec>=1.10", "2")], OLD, True, "2", ""),
    ("broken package", [be(importlib, "import_module", failing(OSError("libz: gone")))],
     partial(package, "eclipse-zenoh"), False, "does not import: libz: gone", "pip"),
    ("few processes", [files(), user(1000), limit(4096, 4096)],
     partial(only, doctor.check_processes), False, "room for 4,096 of 9,036", "ulimit -u"),
    ("others' processes",
     [files(pid_max="32768", loadavg="0.1 0.1 0.1 1/30000 77"), user(0)],
     partial(only, doctor.check_processes), False,
     "room for 2,768 of 9,036 (kernel.pid_max (sysctl))", "at least 6,268"),
    ("control group", [files(cgroup="0::/user/job", **GROUP), user(0)],
     partial(only, doctor.check_processes), False, "room for 410", "pids.max"),
    ("old control group", [files(cgroup="7:pids:/user/job", **GROUP), user(0)],
     partial(only, doctor.check_processes), False, "room for 410", "pids.max"),
    ("no limit", [files(cgroup="0::/", **{"pids.max": "max"}), user(0)],
     partial(only, doctor.check_processes), True, "", ""),
    ("little memory", [memory(1_200_000_000)], partial(only, doctor.check_memory),
     False, "1.2 GB free, room for about 100 cells", "at most 100 cells"),
    ("group's memory", [files(cgroup="0::/", **MEMORY)],
     partial(only, doctor.check_memory), False, "", "at most 0 cells"),
    ("no loopback", [be(socket, "socket", Unbindable)],
     partial(only, doctor.check_port), False, "cannot assign", "lo"),
    ("no temporary folder", [be(tempfile, "tempdir", "/is/not/there")],
     partial(only, doctor.check_temporary), False, "", "TMPDIR"),
    ("no place for kernels", [be(tempfile, "NamedTemporaryFile", NO_FILE)],
     partial(only, doctor.check_cache), False, "read-only", "NUMBA_CACHE_DIR"),
    ("Zenoh hangs", [child(SILENT)], partial(only, doctor.check_zenoh), False,
     "no answer within 20 s", "eclipse-zenoh"),
    ("fork server hangs", [child(SILENT)], partial(only, doctor.check_fork_server),
     False, "no answer within 20 s", "seccomp"),
    ("Zenoh fails", [ended(1, "Traceback\nZError: no\n")],
     partial(only, doctor.check_zenoh), False, "ZError: no", "eclipse-zenoh"),
    ("Zenoh crashes", [ended(-11, "")], partial(only, doctor.check_zenoh), False,
     "code -11", "eclipse-zenoh"),
]  # fmt: skip


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_what_is_wrong_is_found_with_how_to_fix_it(
    row: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, patches, look, ok, found, fix = row
    for patch in patches:
        patch(monkeypatch)
    finding = look()
    assert finding.ok is ok
    assert finding.found.startswith(found)
    assert fix in finding.fix
    assert bool(finding.fix) == bool(fix)


def test_all_the_projects_packages_are_looked_at() -> None:
    found = {finding.what for finding in doctor.check_packages()}
    assert {"package eclipse-zenoh", "package matplotlib (optional)"} <= found


@pytest.mark.parametrize(
    ("hard", "ok", "found"),
    [
        (1024, False, "soft 256, hard 1,024"),
        (UNLIMITED, True, "soft 256, hard unlimited"),
    ],
)
def test_the_limit_of_open_files_is_looked_at_and_stays(
    monkeypatch: pytest.MonkeyPatch, hard: int, ok: bool, found: str
) -> None:
    limit(256, hard)(monkeypatch)
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: asked.append(limits))
    finding = only(doctor.check_files)
    assert (finding.ok, finding.found) == (ok, found)
    assert ok or "limits.conf" in finding.fix
    assert asked[-1] == (256, hard)


def test_a_temporary_folder_too_deep_for_sockets_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    deep = tmp_path / ("x" * 100)
    deep.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(deep))
    finding = only(doctor.check_temporary)
    assert not finding.ok
    assert "of 107 bytes" in finding.found
    assert "short" in finding.fix


def test_a_folder_that_takes_no_recording_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "NamedTemporaryFile", NO_FILE)
    finding = only(doctor.check_logs)
    assert (finding.ok, finding.found) == (False, "read-only file system")
    assert str(tmp_path / "logs") in finding.fix


@pytest.mark.zenoh
@pytest.mark.slow
def test_a_zenoh_that_does_not_open_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    deep = tmp_path / ("x" * 100)  # no socket can be listened on in there
    deep.mkdir()
    monkeypatch.setenv("TMPDIR", str(deep))
    finding = only(doctor.check_zenoh)
    assert not finding.ok
    assert "hub: must be able to listen on" in finding.found


def test_a_check_that_breaks_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    checks: dict[str, Check] = {"memory": failing(ImportError("no module psutil"))}
    monkeypatch.setattr(doctor, "_CHECKS", checks)
    finding = only(examine)
    assert finding.what == "memory"
    assert not finding.ok
    assert "no module psutil" in finding.found


@pytest.mark.zenoh
@pytest.mark.slow
def test_all_is_well_here() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    findings = examine()
    assert [finding for finding in findings if not finding.ok] == []
    assert {"Zenoh", "fork server", "open files, 1,000 cells"} <= {
        finding.what for finding in findings
    }
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == before
