"""``neurosnap coordinate``: a run whose other parts are started separately."""

from pathlib import Path
from typing import Annotated

import typer

from neurosnap.apps.cli.config import described
from neurosnap.apps.cli.options import (
    AUTO_HOSTS,
    NETWORK,
    RECORDING,
    Described,
    Given,
    option,
    with_run_options,
)
from neurosnap.apps.cli.shared import (
    Connect,
    Json,
    app,
    check_swarm,
    errors,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import HostChoice


@app.command()
@with_run_options(
    *("out", "folder", "split", "keep", "sync"),
    *("restart", "max_restarts", "restart_window", "backoff", "listen", "audit"),
    *("place", "ray_address"),
)
def coordinate(
    context: typer.Context,
    source: Described,
    connect: Connect,
    swarm: Annotated[
        str,
        typer.Option(
            metavar="ID",
            rich_help_panel=NETWORK,
            help="Name of the swarm, the same for all its parts: letters and digits.",
        ),
    ],
    given: Given = None,
    cells: HostChoice = option("cells", AUTO_HOSTS),
    record: bool = option(
        "record", "Wait for a recorder (`neurosnap record`) before starting."
    ),
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="LOG",
            rich_help_panel=RECORDING,
            help="Go on with the run of this recording, after its last whole tick.",
        ),
    ] = None,
    patience: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            rich_help_panel=NETWORK,
            help="How long to wait until all other parts have connected.",
        ),
    ] = 60.0,
    as_json: Json = False,
) -> None:
    """Coordinate a run whose other parts are started by hand, here or elsewhere.

    Start `neurosnap hub` first; then this, `neurosnap world`, `record` and
    `join`, in any order, on any machine. SOURCE and options are those of `run`.
    """
    from neurosnap.apps.cli import output
    from neurosnap.recording.replay.resume import past_of
    from neurosnap.runtime.request import RunRequest, Site
    from neurosnap.runtime.run import run as run_swarm

    with errors():
        check_swarm(swarm)
        prepared = described(context)
        options, network = prepared.options, prepared.network
        if options.cells == "inline":
            rule = "must be 'process' or 'worker', for others to start them"
            raise InvalidValueError("cells", rule, options.cells)
        if prepared.chosen:
            screen.print(prepared.chosen, markup=False, soft_wrap=True)
        past = None if resume is None else past_of(resume, options)
        parts = [
            "world",
            *options.host_names(),
            *(["recorder"] if prepared.log else []),
        ]
        site = Site(network, swarm=swarm, elsewhere=frozenset(parts), patience=patience)
        request = RunRequest(options, None, past, site)
        with output.progress(screen, "ticks", options.ticks) as on_tick:
            watcher = output.watcher(screen, on_tick)
            outcome = run_async(lambda stop: run_swarm(request, stop, watcher))
        output.outcome(say(as_json), options, outcome, None)
        if as_json:
            facts = output.outcome_facts(options, outcome, None)
            # The recording, and whether it is whole, is the recorder's to say.
            its = ("log", "complete", "kept", "journal", "waiting")
            kept = {k: v for k, v in facts.items() if k not in its}
            told = {} if past is None else {"resumed_at": past.tick}
            print_json({"swarm": swarm, **kept, **told})
