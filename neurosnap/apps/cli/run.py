"""``neurosnap run`` and ``resume``: run a source through a swarm, and go on."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from neurosnap.apps.cli.options import (
    FLAG,
    NETWORK,
    Described,
    Given,
    request_of,
    with_run_options,
)
from neurosnap.apps.cli.output import (
    outcome_facts,
    outcome_lines,
    print_facts,
    progress,
    say,
    watcher,
)
from neurosnap.apps.cli.page import check_page, viewed
from neurosnap.apps.cli.shared import (
    LEARN,
    LOST,
    Format,
    Log,
    app,
    errors,
    new_log,
    run_async,
)
from neurosnap.errors import InvalidValueError

if TYPE_CHECKING:
    from neurosnap.runtime.request import Outcome, RunRequest

import os
import socket
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Self

_EXAMPLE = "Example: neurosnap run neurosnap/Path-v0 --ticks 300 --out a.mcap"


@app.command(epilog=_EXAMPLE, rich_help_panel=LEARN)
@with_run_options(
    *("ticks", "seed", "agent", "target", "snapshot", "threshold"),
    *("cells", "workers", "elsewhere", "out", "listen", "connect", "tls"),
)
def run(
    context: typer.Context,
    source: Described,
    given: Given = None,
    swarm: Annotated[
        str,
        typer.Option(
            metavar="ID",
            rich_help_panel=NETWORK,
            help="Name of this swarm, by which others find it: letters and digits.",
            show_default="a random one",
        ),
    ] = "",
    view: Annotated[
        bool,
        typer.Option(
            "--view",
            metavar=FLAG,
            help="Show the run in the browser while it goes on.",
        ),
    ] = False,
    form: Format = "text",
) -> None:
    """Learn from a world, a file or live sensors, and record everything."""
    with errors():
        if view:
            check_page()
        request = request_of(context)
        if view and request.log is None:
            rule = "must go with a recording, which is what is looked at"
            raise InvalidValueError("view", rule, "no recording")
        outcome = _carry_out(request, form, view=view)
        print_facts(form, outcome_facts(request.options, outcome, request.log))
        _end_by(outcome)


@app.command(rich_help_panel=LEARN)
def resume(
    log: Log,
    ticks: Annotated[
        int | None,
        typer.Option(
            help="How many ticks the run has in the end.",
            show_default="300 more than it has",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE.mcap",
            help="Where to record; must not exist yet.",
            show_default="logs/SOURCE-DATE.mcap",
        ),
    ] = None,
    form: Format = "text",
) -> None:
    """Continue a run after its last whole tick, in a new recording."""
    from neurosnap.runtime.run import resumed

    with errors():
        request = resumed(log, ticks)
        options, after = request.options, request.after
        request = replace(request, log=new_log(options.source, out))
        outcome = _carry_out(request, form)
        facts = outcome_facts(options, outcome, request.written)
        print_facts(form, {**facts, "resumed": str(log), "resumed_at": after})
        _end_by(outcome)


def _carry_out(request: "RunRequest", form: str, *, view: bool = False) -> "Outcome":
    """Run a swarm and say how it went, in the browser too if that was asked for."""
    from neurosnap.runtime.run import run as run_swarm

    if request.log is not None:
        request.log.parent.mkdir(exist_ok=True)

    def report(outcome: "Outcome") -> None:
        say(form, *outcome_lines(request.options, outcome, request.written))

    ticks = request.options.ticks
    with ServiceManager() as service, progress("ticks", ticks) as shown:

        def on_tick(tick: int) -> None:
            shown(tick)
            service.progress(tick)

        async def work(stop: asyncio.Event) -> "Outcome":
            return await run_swarm(request, stop, watcher(on_tick))

        if view and (new := request.log) is not None:
            return run_async(lambda stop: viewed(new, stop, work, report))
        outcome = run_async(work)
    report(outcome)
    return outcome


def _end_by(outcome: "Outcome") -> None:
    """End with `LOST` if something was lost."""
    whole = outcome.completeness is None or outcome.complete
    if outcome.lost or not whole:
        raise typer.Exit(LOST)


_STATUS = 1.0  # seconds between two words about how far it is


class ServiceManager:
    """Who started this process and waits to hear from it. Use as a context manager.

    Args:
        environment: Where ``NOTIFY_SOCKET`` and ``WATCHDOG_USEC`` are looked for; None:
            this process's own.
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        given = os.environ if environment is None else environment
        self._address = given.get("NOTIFY_SOCKET", "")
        if self._address.startswith("@"):  # not in the file system
            self._address = "\0" + self._address[1:]
        self._socket: socket.socket | None = None
        watchdog = given.get("WATCHDOG_USEC", "")
        self._period = int(watchdog) / 2e6 if watchdog.isdecimal() else _STATUS
        self._is_up = False
        self._next = 0.0

    def __enter__(self) -> Self:
        if self._address:
            flags = socket.SOCK_DGRAM | socket.SOCK_CLOEXEC
            self._socket = socket.socket(socket.AF_UNIX, flags)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._socket is not None:
            self._tell("STOPPING=1")
            self._socket.close()
            self._socket = None

    def progress(self, tick: int) -> None:
        """Say that the run is up, if that was not said, and that it goes on.

        Called as long as it does; says it once a second at most, or as often as the
        manager asks for.

        Args:
            tick: How far it is.
        """
        now = time.monotonic()
        if self._socket is None or now < self._next:
            return
        self._next = now + min(self._period, _STATUS)
        ready = "" if self._is_up else "READY=1\n"
        self._is_up = True
        self._tell(f"{ready}WATCHDOG=1\nSTATUS=tick {tick}")

    def _tell(self, text: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(text.encode(), self._address)
        except OSError:  # a manager that does not listen is no reason to end a run
            self._socket.close()
            self._socket = None
