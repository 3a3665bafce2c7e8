"""The doctor: what each check says when something is wrong, and when all is well."""

import importlib
import importlib.metadata
import os
import resource
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import psutil
import pytest

from neurosnap.apps import doctor
from neurosnap.apps.doctor import Finding, examine
from neurosnap.runtime import preflight

Check = Callable[[], list[Finding]]


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


def require(monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: list(lines))


def test_an_old_python_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 10, 4))
    finding = only(doctor.check_python)
    assert not finding.ok
    assert finding.found == "3.10.4"
    assert "3.11" in finding.mend


def test_a_missing_package_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    require(monkeypatch, "no-such-thing>=2.1")
    finding = package("no-such-thing")
    assert not finding.ok
    assert finding.found == "not installed"
    assert finding.mend == 'Run `python -m pip install "no-such-thing>=2.1"`.'


def test_a_missing_optional_package_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    require(monkeypatch, 'no-such-thing>=2.1; extra == "plot"')
    finding = package("no-such-thing")
    assert finding.ok
    assert finding.found == "not installed"
    assert finding.mend


@pytest.mark.parametrize(
    ("there", "fine"),
    [("1.9.9", False), ("1.10rc1", True), ("1.10", True), ("2", True)],
)
def test_a_package_that_is_too_old_is_found(
    monkeypatch: pytest.MonkeyPatch, there: str, fine: bool
) -> None:
    require(monkeypatch, "msgspec>=1.10")
    monkeypatch.setattr(importlib.metadata, "version", lambda _: there)
    finding = package("msgspec")
    assert finding.ok is fine
    assert finding.found == (there if fine else f"{there}, older than 1.10")


def test_a_package_that_does_not_import_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(importlib, "import_module", failing(OSError("libz.so: gone")))
    finding = package("eclipse-zenoh")
    assert not finding.ok
    assert "libz.so: gone" in finding.found


def test_all_the_projects_packages_are_looked_at() -> None:
    found = {finding.what for finding in doctor.check_packages()}
    assert {"package eclipse-zenoh", "package matplotlib (optional)"} <= found


def test_another_platform_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    finding = only(doctor.check_platform)
    assert finding.ok
    assert "left-over" in finding.mend


def test_a_low_limit_of_open_files_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (256, 1024))
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: asked.append(limits))
    finding = only(doctor.check_files)
    assert not finding.ok
    assert finding.found == "soft 256, hard 1,024"
    assert "ulimit -Hn" in finding.mend
    assert "limits.conf" in finding.mend
    assert asked == [(256, 1024)]


def test_a_low_soft_limit_will_do_and_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (256, resource.RLIM_INFINITY))
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: asked.append(limits))
    finding = only(doctor.check_files)
    assert finding.ok
    assert finding.found == "soft 256, hard unlimited"
    assert asked[-1] == (256, resource.RLIM_INFINITY)


def files(monkeypatch: pytest.MonkeyPatch, **texts: str) -> None:
    """Let files of the kernel's, by their names, say `texts`; others nothing."""
    monkeypatch.setattr(preflight, "_read", lambda path: texts.get(path.name, ""))


def test_a_low_limit_of_processes_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    files(monkeypatch)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (4096, 4096))
    finding = only(doctor.check_processes)
    assert not finding.ok
    assert finding.found.startswith("room for 4,096 of 9,036")
    assert "ulimit -u" in finding.mend


def test_what_others_use_is_not_free(monkeypatch: pytest.MonkeyPatch) -> None:
    files(monkeypatch, pid_max="32768", loadavg="0.1 0.1 0.1 1/30000 77")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    finding = only(doctor.check_processes)
    assert not finding.ok
    assert finding.found == "room for 2,768 of 9,036 (kernel.pid_max (sysctl))"


@pytest.mark.parametrize("line", ["0::/user/job", "7:pids:/user/job"])
def test_a_low_limit_of_the_control_group_is_found(
    monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    files(monkeypatch, cgroup=line, **{"pids.max": "500", "pids.current": "90"})
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    finding = only(doctor.check_processes)
    assert not finding.ok
    assert "room for 410" in finding.found
    assert "pids.max" in finding.mend


def test_no_limit_of_processes_is_fine(monkeypatch: pytest.MonkeyPatch) -> None:
    files(monkeypatch, cgroup="0::/", **{"pids.max": "max"})
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert only(doctor.check_processes).ok


def test_little_memory_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    free = SimpleNamespace(available=1_200_000_000)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: free)
    finding = only(doctor.check_memory)
    assert not finding.ok
    assert finding.found == "1.2 GB free, room for about 100 cells"
    assert "at most 100 cells" in finding.mend


def test_the_control_groups_memory_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    group = {"memory.max": "2000000000", "memory.current": "1500000000"}
    files(monkeypatch, cgroup="0::/", **group)
    finding = only(doctor.check_memory)
    assert not finding.ok
    assert "at most 0 cells" in finding.mend


def test_one_core_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3})
    finding = only(doctor.check_cores)
    assert finding.ok
    assert finding.found == "1"
    assert finding.mend


def test_a_missing_loopback_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Unbindable(socket.socket):
        bind = failing(OSError("cannot assign"))

    monkeypatch.setattr(socket, "socket", Unbindable)
    finding = only(doctor.check_port)
    assert not finding.ok
    assert "cannot assign" in finding.found
    assert "lo" in finding.mend


def test_an_unwritable_temporary_folder_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "is" / "not" / "there"))
    finding = only(doctor.check_temporary)
    assert not finding.ok
    assert "TMPDIR" in finding.mend


def test_a_temporary_folder_too_deep_for_sockets_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    deep = tmp_path / ("x" * 100)
    deep.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(deep))
    finding = only(doctor.check_temporary)
    assert not finding.ok
    assert "of 107 bytes" in finding.found
    assert "short" in finding.mend


def test_a_folder_that_takes_no_recording_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "logs").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        tempfile, "NamedTemporaryFile", failing(OSError("read-only file system"))
    )
    finding = only(doctor.check_logs)
    assert not finding.ok
    assert finding.found == "read-only file system"
    assert str(tmp_path / "logs") in finding.mend


def test_kernels_without_a_place_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        tempfile, "NamedTemporaryFile", failing(PermissionError("denied"))
    )
    finding = only(doctor.check_cache)
    assert not finding.ok
    assert "NUMBA_CACHE_DIR" in finding.mend


@pytest.mark.parametrize("check", [doctor.check_zenoh, doctor.check_fork_server])
def test_a_child_that_hangs_is_found(
    monkeypatch: pytest.MonkeyPatch, check: Check
) -> None:
    monkeypatch.setattr(subprocess, "run", failing(subprocess.TimeoutExpired("x", 20)))
    finding = only(check)
    assert not finding.ok
    assert finding.found == "no answer within 20 s"
    assert finding.mend


@pytest.mark.parametrize(
    ("code", "said", "found"),
    [(1, "Traceback\nZError: no\n", "ZError: no"), (-11, "", "code -11")],
)
def test_a_child_that_fails_is_found(
    monkeypatch: pytest.MonkeyPatch, code: int, said: str, found: str
) -> None:
    done = subprocess.CompletedProcess("x", code, stdout="", stderr=said)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)
    finding = only(doctor.check_zenoh)
    assert not finding.ok
    assert finding.found == found
    assert "eclipse-zenoh" in finding.mend


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
