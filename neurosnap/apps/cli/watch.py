"""``neurosnap watch``, ``view``, ``ps`` and ``stop``: observe and stop swarms."""

import asyncio
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    Form,
    Format,
    convert,
    end_by,
    errors,
    run_async,
)
from neurosnap.apps.cli.run_at_a_glance import Glance
from neurosnap.apps.cli.run_flags import FLAG, NETWORK, option, with_parameters
from neurosnap.apps.cli.serve_page import look
from neurosnap.apps.cli.terminal_output import (
    changed_line,
    print_facts,
    print_json,
    say,
    screen,
    table,
    warn,
    watcher,
)
from neurosnap.errors import InvalidValueError
from neurosnap.fabric.wait_for_events import first_of
from neurosnap.runtime.network import Network
from neurosnap.runtime.request import SILENT
from neurosnap.sensorium import visible

if TYPE_CHECKING:
    from neurosnap.runtime.anomaly_feed import Fed
    from neurosnap.runtime.registry import Note


@app.command()
@with_parameters(
    connect=(
        str,
        typer.Option(
            "",
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where the hub of a swarm on another machine listens.",
        ),
    ),
    tls=(str, option("tls")),
    insecure=(bool, option("insecure")),
)
def watch(
    context: typer.Context,
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="[SWARM|LOG]",
            help="The id of a swarm that runs, or a recording.",
            show_default="the swarm that runs on this machine",
        ),
    ] = None,
    support: Annotated[
        int | None,
        typer.Option(
            metavar="OCCASIONS",
            min=0,
            help="Report only anomalies that break an implication which was put to the"
            " test, and held, on this many occasions. 0: report all.",
            show_default="as the run says",
        ),
    ] = None,
    form: Annotated[
        Form,
        typer.Option(
            "--format", help="Print text, or each as one JSON object on a line."
        ),
    ] = "text",
) -> None:
    """Show anomalies, observations that contradict what was learned, and alarms.

    An anomaly names the sensors that may be wrong, and the implications it breaks. An
    alarm names a sensor that seems broken; its end is reported, too. So is a sensor
    that is grown, or retired.

    For a recording, shows those of all ticks; for a swarm, those to come, until Ctrl-C.
    Anomalies that rest on few occasions are left out: see --support.
    """
    with errors():
        if what is not None and _is_recording(what):
            _watch_recording(Path(what), support, form)
        else:
            _watch_swarm(what, context.params, support, form)


def _watch_recording(log: Path, support: int | None, form: str) -> None:
    from neurosnap.apps.library import Recording
    from neurosnap.protocol.anomaly_report import NamedAnomaly
    from neurosnap.runtime.anomaly_feed import without_anomalies

    recording = Recording(log)
    found = False
    for told in recording.anomalies(support):
        _report(told, form)
        found |= isinstance(told, NamedAnomaly)
    if not found and form == "text":
        say(form, without_anomalies(recording.file, support))
    end_by(recording.file)


def _watch_swarm(
    what: str | None, given: dict[str, Any], support: int | None, form: str
) -> None:
    from neurosnap.runtime import registry
    from neurosnap.runtime.anomaly_feed import watch as look_on

    connect = given["connect"]
    if connect and what is None:
        raise InvalidValueError("swarm", "must be named with --connect", what)
    swarm, log = what or "", None
    if not connect:
        note = registry.find(what or "")
        swarm, connect = note.swarm, note.endpoint
        log = Path(note.log) if note.log else None
    secured = {name: given[name] for name in ("tls", "insecure")}
    network = convert(Network, connect=connect, **secured)
    network.check("watcher")
    warn(f"watching {swarm}; Ctrl-C ends it")
    show, glance = partial(_report, form=form), Glance()
    fed = watcher(glance) if screen.is_terminal else SILENT
    follow = partial(look_on, support=support, log=log, watcher=fed)
    with glance.shown():
        run_async(lambda stop: follow(network, swarm, stop, show))


def _report(told: "Fed", form: str) -> None:
    """Print an anomaly, news of health, or a change of the sensors."""
    from neurosnap.agent.growth_in_decisions import Changed
    from neurosnap.health.alarm import News
    from neurosnap.protocol.anomaly_report import anomaly_line

    if form == "json":
        print_json(told)
    elif isinstance(told, News):
        say(form, visible(told.line()))
    elif isinstance(told, Changed):
        say(form, changed_line(told))
    else:
        say(form, anomaly_line(told))


@app.command()
def view(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LOG|SWARM...",
            help="Recordings (.mcap), one or more to compare; or the ids of swarms that"
            " run here.",
            show_default="all swarms that run here",
        ),
    ] = None,
    port: Annotated[
        int,
        typer.Option(
            help="The port of the page, on this machine only. 0: that of the last"
            " page, or any free one."
        ),
    ] = 0,
    browser: Annotated[
        bool, typer.Option(metavar=FLAG, help="Open the browser.")
    ] = True,
    form: Annotated[
        Form,
        typer.Option(
            "--format",
            help="Print the address of the page, or one JSON object with it.",
        ),
    ] = "text",
) -> None:
    """Show recordings, or swarms while they run, in the browser."""
    with errors():
        logs = _logs(what or [])

        async def work(stop: asyncio.Event) -> None:
            shown = look(logs, stop, port=port, browser=browser, as_json=form == "json")
            await first_of(shown, stop.wait())
            os._exit(0)  # nothing is left to tidy up, and a thread may read for long

        run_async(work)


def _logs(given: list[str]) -> list[Path]:
    """Return recordings, and where swarms of this machine are recorded.

    Args:
        given: Recordings and the ids of swarms; empty for all swarms that run.
    """
    from neurosnap.runtime import registry

    if not given and not (given := [note.swarm for note in registry.swarms()]):
        raise InvalidValueError("swarm", "must run here, or a recording be given", "")
    found: list[Path] = []
    for each in given:
        if _is_recording(each):
            found.append(Path(each))
        elif log := registry.find(each).log:
            found.append(Path(log))
        else:
            raise InvalidValueError("swarm", "must be recorded to be viewed", each)
    return found


def _is_recording(what: str) -> bool:
    """Return whether an argument names a recording, and not a swarm."""
    return what.lower().endswith(".mcap") or Path(what).is_file()


@app.command()
def ps(form: Format = "text") -> None:
    """List the swarms that run on this machine.

    Lost is how many readings of a recorded run had no tick although they should have; a
    stretch in which it could not listen counts as one. Behind is for how long readings
    waited for the last tick, if for too long, and which part takes most of a tick.
    """
    from neurosnap.runtime import registry

    with errors():
        notes = registry.swarms()
        swarms = [msgspec.structs.asdict(n) | {"lost": _lost(n)} for n in notes]
        heads = ("swarm", "pid", "source", "lost", "behind", "log")
        rows = [[str(one[head] or "") for head in heads] for one in swarms]
        say(form, *(table([heads, *rows]) if rows else ["no swarm runs here"]))
        print_facts(form, {"swarms": swarms})


def _lost(note: "Note") -> int:
    """Return how many readings a run has lost, as its journal says."""
    from neurosnap.sources.live.journal import journal_of, read_journal
    from neurosnap.sources.live.statistics import Statistics
    from neurosnap.sources.open import lost_by

    if not note.log:
        return 0
    kept = read_journal(journal_of(Path(note.log)))
    return lost_by(note.source, Statistics(kept.taken.received))


@app.command()
def stop(
    swarm: Annotated[
        str | None,
        typer.Argument(
            metavar="[SWARM]",
            help="The id of the swarm; `neurosnap ps` lists them.",
            show_default="the swarm that runs on this machine",
        ),
    ] = None,
    patience: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="How long to wait until it has ended."),
    ] = 30.0,
    form: Format = "text",
) -> None:
    """End a swarm of this machine in order, with its recording finished."""
    from neurosnap.runtime import registry

    with errors():
        note = registry.find(swarm or "")
        registry.stop(note, patience)
        say(form, f"stopped {note.swarm}")
        print_facts(form, {"stopped": note.swarm, "log": note.log})
