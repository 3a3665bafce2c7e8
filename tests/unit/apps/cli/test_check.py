"""The doctor: what each check says when something is wrong, and when all is well."""

import resource
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest

import neurosnap.apps.cli.check as doctor
from neurosnap.apps.cli.check import examine
from neurosnap.runtime import preflight

KERNELS = "NUMBA_CACHE_DIR"


def ended(code: int, said: str) -> Any:
    done = subprocess.CompletedProcess("x", code, stdout="", stderr=said)
    return lambda *_, **__: done


def failing(error: Exception) -> Any:
    def fail(*_: object, **__: object) -> Any:
        raise error

    return fail


GONE = failing(OSError("read-only file system"))
ROWS = {
    # What is wrong, in which check it is found, and the fix.
    "a swarm hangs": (
        (subprocess, "run", failing(subprocess.TimeoutExpired("x", 20))),
        ("a swarm of two cells", "timed out after 20 seconds", "seccomp"),
    ),
    "a swarm fails": (
        (subprocess, "run", ended(1, "Traceback\nZError: no\n")),
        ("a swarm of two cells", "ZError: no", "TMPDIR"),
    ),
    "a swarm crashes": (
        (subprocess, "run", ended(-11, "")),
        ("a swarm of two cells", "code -11", "install"),
    ),
    "little memory": (
        (preflight, "free_memory", lambda: 1_200_000_000),
        ("1,000 cells", "cells: must be at most 100 here: each takes 6 MB", "fewer"),
    ),
    "no place for kernels": (
        (tempfile, "NamedTemporaryFile", GONE),
        ("compiled kernels", "read-only file system", KERNELS),
    ),
    "no place for recordings": (
        (tempfile, "NamedTemporaryFile", GONE),
        ("recordings", "read-only file system", "--out"),
    ),
    "no keys": (
        (subprocess, "run", ended(0, "")),
        ("keys", "must be a folder made by `neurosnap init keys`", "copy"),
    ),
}


@pytest.mark.parametrize("case", ROWS)
def test_what_is_wrong_is_found_with_how_to_fix_it(
    case: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    patched, (what, found, fix) = ROWS[case]
    monkeypatch.setattr(subprocess, "run", ended(0, ""))
    monkeypatch.setattr(*patched)
    (finding,) = (each for each in examine(tmp_path) if each.what == what)
    assert not finding.ok
    assert found in finding.found
    assert fix in finding.fix


@pytest.mark.zenoh
@pytest.mark.slow
def test_all_is_well_here() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    findings = examine()
    assert [finding for finding in findings if not finding.ok] == []
    assert [finding.what for finding in findings] == list(doctor._CHECKS)
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == before
