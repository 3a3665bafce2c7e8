"""``neurosnap watch``: prints anomalies, live or from a recording."""

from pathlib import Path
from typing import Annotated

import typer

from neurosnap.apps.cli.options import FLAG, NETWORK, option
from neurosnap.apps.cli.shared import (
    app,
    convert,
    end_by,
    errors,
    print_json,
    run_async,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.runtime.network import Network
from neurosnap.sensorium import visible


@app.command()
def watch(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="[SWARM|LOG]",
            help="The id of a swarm that runs, or a recording.",
            show_default="the swarm that runs on this machine",
        ),
    ] = None,
    connect: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where the hub of a swarm on another machine listens.",
        ),
    ] = "",
    tls: str = option("tls"),
    insecure: bool = option("insecure"),
    support: Annotated[
        int | None,
        typer.Option(
            metavar="OCCASIONS",
            min=0,
            help="Tell only of anomalies that break an implication which was put to the"
            " test, and held, on this many occasions. 0: tell of all.",
            show_default="as the run was told",
        ),
    ] = None,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", metavar=FLAG, help="Print each as a JSON object on a line."
        ),
    ] = False,
) -> None:
    """Show anomalies, observations that contradict what was learned, and alarms.

    An anomaly names the sensors that may be wrong, and the implications it breaks. An
    alarm names a sensor that seems broken; it is told when it is well again, too. So
    is a sensor that is grown, or retired.

    Of a recording those of all ticks are shown; of a swarm, those that come, until
    Ctrl-C. What the run learned too little of to go by is left out: see --support.
    """
    from neurosnap.agent.growth.changed import Changed
    from neurosnap.apps.growth_text import changed_line
    from neurosnap.health.news import News
    from neurosnap.protocol.anomaly_messages import Told, anomaly_line
    from neurosnap.recording.read.recording import Recording
    from neurosnap.runtime import registry
    from neurosnap.runtime.anomaly_feed import Fed, recorded, without_anomalies
    from neurosnap.runtime.anomaly_feed import watch as look_on

    def show(told: Fed) -> None:
        if as_json:
            print_json(told)
        elif isinstance(told, News):
            typer.echo(visible(told.line()))
        elif isinstance(told, Changed):
            typer.echo(changed_line(told))
        else:
            typer.echo(anomaly_line(told))

    with errors():
        if what is not None and (what.endswith(".mcap") or Path(what).is_file()):
            recording = Recording.open(Path(what))
            found = False
            for told in recorded(recording, support):
                show(told)
                found |= isinstance(told, Told)
            if not found and not as_json:
                typer.echo(without_anomalies(recording, support))
            end_by(recording)
            return
        if connect and what is None:
            raise InvalidValueError("swarm", "must be named with --connect", what)
        swarm, log = what or "", None
        if not connect:
            note = registry.find(what) if what else registry.only()
            swarm, connect = note.swarm, note.endpoint
            log = Path(note.log) if note.log else None
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        network.check("watcher")
        screen.print(f"watching {swarm}; Ctrl-C ends it", markup=False)
        run_async(
            lambda stop: look_on(network, swarm, stop, show, support=support, log=log)
        )
