"""Checks whether this machine can run a swarm of a thousand cells.

Every finding says how to fix it. A check never hangs and never raises: what might do
either runs in a separate process, and an error is a finding too. Packages
are imported where they are used, so that a missing one is found and does not end it.
"""

import importlib
import importlib.metadata
import multiprocessing
import os
import queue
import re
import resource
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from neurosnap.errors import NeurosnapError
from neurosnap.runtime.preflight import (
    BYTES_A_CELL,
    BYTES_BESIDE,
    THREADS_A_CELL,
    free_memory,
    process_limits,
)
from neurosnap.system.distribution import NAME

if TYPE_CHECKING:
    import zenoh

CELLS = 1000
"""The cells a machine is examined for."""

_SERVICES = 4  # hub, recorder, coordinator, world
_LONGEST_SOCKET = 107  # bytes of a path in `sockaddr_un`, the closing zero left out
_PATIENCE = 20.0  # seconds that a child may take
# Distributions that are imported under another name.
_MODULES = {"eclipse-zenoh": "zenoh"}
_REQUIREMENT = re.compile(r"([A-Za-z0-9._-]+)\s*(?:>=\s*([0-9.]+))?")


class Finding(msgspec.Struct, frozen=True):
    """One thing that was looked at."""

    what: str
    """The thing."""
    ok: bool
    """Whether it will do."""
    found: str
    """What there is."""
    fix: str = ""
    """What to do about it, one sentence; advice where it will do as it is."""


def examine(keys: Path | None = None) -> list[Finding]:
    """Look at everything a swarm needs. Takes some seconds; leaves nothing behind.

    Args:
        keys: A folder of keys to look at, too.
    """
    checks = dict(_CHECKS)
    if keys is not None:
        checks["keys"] = lambda: check_keys(keys)
    return [
        finding for name, check in checks.items() for finding in _safely(name, check)
    ]


def _safely(name: str, check: Callable[[], list[Finding]]) -> list[Finding]:
    """Return what `check` finds, or that it could not look."""
    try:
        return check()
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        found = f"could not be examined: {type(error).__name__}: {error}"
        return [Finding(name, False, found, "Fix what the error names and try again.")]


# Software ----------------------------------------------------------------------------


def check_packages() -> list[Finding]:
    """Import every required package and compare its version; optional ones too."""
    return [
        _package(name, oldest, optional)
        for name, oldest, optional in _requirements(NAME)
    ]


def _requirements(distribution: str) -> Iterator[tuple[str, str, bool]]:
    """Yield name, oldest version and whether it is optional, as declared."""
    for line in importlib.metadata.requires(distribution) or ():
        requirement, _, marker = line.partition(";")
        match = _REQUIREMENT.match(requirement.strip())
        if match:
            yield match[1], match[2] or "0", "extra" in marker


def _package(name: str, oldest: str, optional: bool) -> Finding:
    advice = f'Run `python -m pip install "{name}>={oldest}"`.'
    what = f"package {name}" + (" (optional)" if optional else "")
    try:
        found = importlib.metadata.version(name)
        importlib.import_module(_MODULES.get(name, name))
    except importlib.metadata.PackageNotFoundError:
        return Finding(what, optional, "not installed", advice)
    except Exception as error:  # noqa: BLE001 - a broken package may raise anything
        return Finding(what, optional, f"does not import: {error}", advice)
    if _numbers(found) < _numbers(oldest):
        return Finding(what, optional, f"{found}, older than {oldest}", advice)
    return Finding(what, True, found)


def _numbers(version: str) -> tuple[int, ...]:
    """Return a release as numbers: ``1.10.2rc1`` as (1, 10, 2)."""
    release = re.match(r"\d+(\.\d+)*", version)
    return tuple(map(int, release[0].split("."))) if release else ()


# Limits ------------------------------------------------------------------------------


def check_files() -> list[Finding]:
    """Compare the limit of open files with what the supervisor asks for."""
    from neurosnap.errors import SwarmError
    from neurosnap.runtime.child_processes import allow_files

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    fix, ok = "", True
    try:
        allow_files(CELLS + _SERVICES)
    except SwarmError as error:
        ok = False
        fix = (
            "Raise it with `ulimit -Hn 20000` as root, or for good with"
            f" `* hard nofile 20000` in /etc/security/limits.conf; {error}."
        )
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    found = f"soft {_shown(soft)}, hard {_shown(hard)}"
    return [Finding(f"open files, {CELLS:,} cells", ok, found, fix)]


def check_processes() -> list[Finding]:
    """Compare every limit on processes and threads with what the cells start."""
    needed = (CELLS + _SERVICES) * THREADS_A_CELL
    room = {name: limit - used for name, limit, used in process_limits()}
    what = f"processes and threads, {CELLS:,} cells"
    if not room:
        return [Finding(what, True, "no limit")]
    tightest = min(room, key=lambda name: room[name])
    ok = room[tightest] >= needed
    fix = (
        f"Raise {tightest} by at least {needed - room[tightest]:,}, or run fewer cells."
    )
    found = f"room for {room[tightest]:,} of {needed:,} ({tightest})"
    return [Finding(what, ok, found, _unless(ok, fix))]


def check_memory() -> list[Finding]:
    """Compare free memory with what the cells take; say how many would fit."""
    free = free_memory()
    fit = max(0, free - BYTES_BESIDE) // BYTES_A_CELL
    ok = fit >= CELLS
    fix = f"Free some memory, or run at most {fit:,} cells."
    found = f"{free / 1e9:.1f} GB free, room for about {fit:,} cells"
    return [Finding(f"memory, {CELLS:,} cells", ok, found, _unless(ok, fix))]


# Files and sockets -------------------------------------------------------------------


def check_port() -> list[Finding]:
    """Bind a loopback port."""
    with socket.socket() as trial:
        try:
            trial.bind(("127.0.0.1", 0))
        except OSError as error:
            fix = "Bring up the loopback interface: `ip link set lo up`."
            return [Finding("loopback port", False, str(error), fix)]
        return [Finding("loopback port", True, f"port {trial.getsockname()[1]} free")]


def check_temporary() -> list[Finding]:
    """Write to the temporary folder; see that a socket's path fits in there."""
    fix = "Set TMPDIR to a short path of a folder you may write to."
    try:
        with tempfile.TemporaryDirectory(prefix="neurosnap-") as folder:
            path = Path(folder) / "hub"
            path.write_bytes(b"\0")
    except OSError as error:
        return [Finding("temporary folder", False, str(error), fix)]
    length = len(os.fsencode(path))
    ok = length <= _LONGEST_SOCKET
    found = f"{tempfile.gettempdir()}, sockets take {length} of {_LONGEST_SOCKET} bytes"
    return [Finding("temporary folder", ok, found, _unless(ok, fix))]


def check_logs() -> list[Finding]:
    """Write where recordings go by default."""
    logs = Path.cwd() / "logs"
    folder = logs if logs.is_dir() else Path.cwd()
    fix = f"Give `--out` a place you may write to, or make {folder} writable."
    return [_writable("recordings", folder, fix)]


def check_cache() -> list[Finding]:
    """Write where the compiled kernels are kept."""
    fix = "Set NUMBA_CACHE_DIR to a writable folder, or each start compiles anew."
    from neurosnap.poc.order import kernels
    from neurosnap.system.compiled import kept_in

    try:
        folder = kept_in(kernels.spread)
    except RuntimeError as error:  # Numba, where it finds no place at all
        return [Finding("compiled kernels", False, str(error), fix)]
    if folder is None:
        return [Finding("compiled kernels", True, "not compiled (NUMBA_DISABLE_JIT)")]
    return [_writable("compiled kernels", folder, fix)]


def _writable(what: str, folder: Path, fix: str) -> Finding:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Not `os.access`: on a read-only or full disk it says yes.
        with tempfile.NamedTemporaryFile(dir=folder) as trial:
            trial.write(b"\0")
    except OSError as error:
        return Finding(what, False, str(error), fix)
    return Finding(what, True, str(folder))


def check_keys(folder: Path) -> list[Finding]:
    """See when the first certificate of a folder expires."""
    from neurosnap.fabric.security.load_keys import expiry, near

    fix = "Make keys with `neurosnap init keys`, or copy the folder whole."
    try:
        until = expiry(folder)
    except NeurosnapError as error:
        return [Finding("keys", False, str(error), fix)]
    now = datetime.now(UTC)
    advice = "Make new ones with `neurosnap init keys`." if near(until, now) else ""
    found = f"the first expires on {until:%F %H:%M} UTC"
    return [Finding("keys", until > now, found, advice)]


# Zenoh and processes -----------------------------------------------------------------


def check_zenoh() -> list[Finding]:
    """Open a hub and two clients on a unix socket and send a message round."""
    fix = "Reinstall it: `python -m pip install --force-reinstall eclipse-zenoh`."
    return [_in_child("Zenoh", "send_round", fix)]


def check_fork_server() -> list[Finding]:
    """Start a child as the cells are started."""
    fix = "Allow processes to be started: look at limits, seccomp and the container."
    return [_in_child("fork server", "start_child", fix)]


def _in_child(what: str, function: str, fix: str) -> Finding:
    """Run one of the functions below in a fresh interpreter that may hang or crash."""
    # Not here: after a session was opened, no child of a fork can open one, and a fork
    # server started here would lack what the supervisor loads into its own.
    code = f"from {__name__} import {function}; {function}()"
    began = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Finding(what, False, f"no answer within {_PATIENCE:g} s", fix)
    except OSError as error:
        return Finding(what, False, str(error), fix)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"code {done.returncode}"])[-1]
        return Finding(what, False, last, fix)
    return Finding(what, True, f"works, {time.perf_counter() - began:.1f} s")


def send_round() -> None:
    """Send a message from one client over a hub to another. For a child process."""
    import zenoh

    from neurosnap.fabric.zenoh.hub import open_hub
    from neurosnap.fabric.zenoh.session import configuration

    came: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def hand_over(sample: zenoh.Sample) -> None:
        came.put(sample.payload.to_bytes())

    with tempfile.TemporaryDirectory(prefix="neurosnap-") as folder:
        endpoint = f"unixsock-stream/{folder}/hub"
        config = configuration("client", connect__endpoints=[endpoint])
        with (
            open_hub([endpoint], 2),
            zenoh.open(config) as receiver,
            zenoh.open(config) as sender,
        ):
            callback = zenoh.handlers.Callback(hand_over, indirect=False)
            subscriber = receiver.declare_subscriber("neurosnap/doctor", callback)
            _send_until_it_comes(sender, came)
            subscriber.undeclare()


def _send_until_it_comes(
    sender: "zenoh.Session", came: queue.SimpleQueue[bytes]
) -> None:
    """Send again and again: the first may be sent before the hub knows who listens."""
    for _ in range(100):
        sender.put("neurosnap/doctor", b"hello")
        try:
            came.get(timeout=0.1)
        except queue.Empty:
            continue
        return
    raise TimeoutError("a message must come round, none did within 10 s")


def start_child() -> None:
    """Start a child from a fork server and see it end. For a child process."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["neurosnap.runtime.child_processes"])
    child = context.Process(target=time.sleep, args=(0,))
    child.start()
    child.join()
    if child.exitcode != 0:
        raise RuntimeError(f"a child must end with 0, got {child.exitcode}")


def _unless(ok: bool, fix: str) -> str:
    return "" if ok else fix


def _shown(limit: int) -> str:
    return "unlimited" if limit == resource.RLIM_INFINITY else f"{limit:,}"


_CHECKS: dict[str, Callable[[], list[Finding]]] = {
    "packages": check_packages,
    "open files": check_files,
    "processes and threads": check_processes,
    "memory": check_memory,
    "loopback port": check_port,
    "temporary folder": check_temporary,
    "Zenoh": check_zenoh,
    "fork server": check_fork_server,
    "recordings": check_logs,
    "compiled kernels": check_cache,
}
