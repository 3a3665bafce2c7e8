"""``neurosnap check``: what would keep a run from starting, in a file or here."""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import option
from neurosnap.apps.cli.output import print_facts, say
from neurosnap.apps.cli.shared import SET_UP, Format, app, errors
from neurosnap.errors import NeurosnapError


@app.command(rich_help_panel=SET_UP)
def check(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE]",
            help="A TOML file that describes a run.",
            show_default="check the machine",
        ),
    ] = None,
    tls: str = option("tls", "Without a file: check the keys in this folder, too."),
    form: Format = "text",
) -> None:
    """Find all that would keep a run from starting, and say how to fix it.

    In a TOML file with line numbers; without one, on this machine.
    """
    with errors():
        if file is None:
            _check_machine(Path(tls) if tls else None, form)
        else:
            _check_file(file, form)


def _check_file(file: Path, form: str) -> None:
    from neurosnap.apps.config.load import load
    from neurosnap.apps.config.prepare import prepare
    from neurosnap.apps.config.problems import ConfigError

    try:
        prepare(load(file))
    except ConfigError as error:
        faults = {"faults": error.faults, "more": error.more}
        print_facts(form, {"file": str(file), **faults})
        raise
    say(form, f"{file}: no faults")
    print_facts(form, {"file": str(file), "faults": [], "more": 0})


def _check_machine(keys: Path | None, form: str) -> None:
    findings = examine(keys)
    for finding in findings:
        mark = "ok " if finding.ok else "bad"
        say(form, f"{mark} {finding.what}: {finding.found}")
        if not finding.ok:
            say(form, f"    → {finding.fix}")
    print_facts(form, {"findings": findings})
    if not all(finding.ok for finding in findings):
        raise typer.Exit(1)


CELLS = 1000
"""The cells a machine is examined for."""

_PATIENCE = 120.0  # seconds that a small run may take: the first one compiles
_RUN = ("run", "neurosnap/Path-v0", "--cells", "process", "--ticks", "3")
_SMALL = ("--set", "places=3", "--set", "recording.record=false")


class Finding(msgspec.Struct, frozen=True):
    """One thing that was examined."""

    what: str
    """The thing."""
    ok: bool
    """Whether it will do."""
    found: str
    """What was found."""
    fix: str = ""
    """What to do about it; empty if it will do."""


def examine(keys: Path | None = None) -> list[Finding]:
    """Look at everything a swarm needs. Takes some seconds; leaves nothing behind.

    Args:
        keys: A folder of keys to look at, too.
    """
    checks = dict(_CHECKS)
    if keys is not None:
        fix = "Make keys with `neurosnap init keys`, or copy the folder whole."
        checks["keys"] = partial(check_keys, keys), fix
    found: list[Finding] = []
    for what, (check, fix) in checks.items():
        try:
            found.append(Finding(what, True, check()))
        except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
            said = str(error) or type(error).__name__
            found.append(Finding(what, False, said, fix))
    return found


def check_room() -> str:
    """Compare memory and all limits with what the cells take."""
    from neurosnap.runtime.preflight import check_cells

    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        check_cells(CELLS)
    finally:  # it raises what may be open, as a run does
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    return "fit into memory and limits"


def check_run() -> str:
    """Run a swarm of two cells: its processes start, and its messages arrive."""
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "neurosnap", *_RUN, *_SMALL],
        capture_output=True,
        text=True,
        timeout=_PATIENCE,
        check=False,
    )
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"code {done.returncode}"])[-1]
        raise NeurosnapError(last)
    return f"works, {time.perf_counter() - began:.1f} s"


def check_logs() -> str:
    """Write where recordings go by default."""
    logs = Path.cwd() / "logs"
    return _written(logs if logs.is_dir() else Path.cwd())


def check_cache() -> str:
    """Write where the compiled kernels are kept."""
    from neurosnap.poc.order import kernels
    from neurosnap.system.compiled import kept_in

    folder = kept_in(kernels.spread)
    return "not compiled (NUMBA_DISABLE_JIT)" if folder is None else _written(folder)


def _written(folder: Path) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    # Not `os.access`: on a read-only or full disk it says yes.
    with tempfile.NamedTemporaryFile(dir=folder) as trial:
        trial.write(b"\0")
    return str(folder)


def check_keys(folder: Path) -> str:
    """See when the first certificate of a folder expires."""
    from neurosnap.fabric.security.load_keys import expiry

    until = expiry(folder)
    if until <= datetime.now(UTC):
        raise NeurosnapError(f"the first expired on {until:%F %H:%M} UTC")
    return f"the first expires on {until:%F %H:%M} UTC"


_CHECKS: dict[str, tuple[Callable[[], str], str]] = {
    f"{CELLS:,} cells": (check_room, "Run fewer cells, or raise what is named."),
    "a swarm of two cells": (
        check_run,
        "Set TMPDIR to a short path of a folder you may write to; allow processes and"
        " sockets (limits, seccomp, the container); or install neurosnap-uma again.",
    ),
    "recordings": (check_logs, "Give `--out` a place you may write to."),
    "compiled kernels": (
        check_cache,
        "Set NUMBA_CACHE_DIR to a writable folder, or each start compiles anew.",
    ),
}
