"""``neurosnap coordinate``: a run whose other parts are started elsewhere."""

from typing import Annotated

import typer

from neurosnap.agent.policy import EXPLORE
from neurosnap.cli.options import (
    Agent,
    Deadline,
    Decay,
    Explore,
    Given,
    Seed,
    Snapshot,
    Source,
    Target,
    Threshold,
    Ticks,
    Wiring,
    Workers,
    run_options,
)
from neurosnap.cli.shared import (
    Connect,
    Insecure,
    Json,
    Tls,
    app,
    check_swarm,
    convert,
    errors,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.swarm.network import Network
from neurosnap.swarm.options import HostKind


@app.command()
def coordinate(
    source: Source,
    connect: Connect,
    swarm: Annotated[str, typer.Option(metavar="ID", help="Its id.")],
    ticks: Ticks = None,
    seed: Seed = 0,
    agent: Agent = "walker",
    target: Target = None,
    explore: Explore = EXPLORE,
    given: Given = None,
    snapshot: Snapshot = "empirical",
    threshold: Threshold = None,
    decay: Decay = None,
    wiring: Wiring = "hasse",
    cells: Annotated[
        HostKind, typer.Option(help="One OS process a cell, or one for many.")
    ] = "process",
    workers: Workers = 2,
    record: Annotated[bool, typer.Option(help="Wait for a recorder.")] = True,
    deadline: Deadline = 10.0,
    patience: Annotated[
        float, typer.Option(help="Seconds until all parts must be there.")
    ] = 60.0,
    tls: Tls = "",
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Be the coordinator of a swarm whose other parts are started elsewhere.

    They are `neurosnap world`, `record` and `join`, in any order, on any host.
    """
    from neurosnap import show
    from neurosnap.swarm.run import run as run_swarm

    with errors():
        check_swarm(swarm)
        options = run_options(
            source=source,
            ticks=ticks,
            seed=seed,
            agent=agent,
            target=target,
            explore=explore,
            given=given,
            snapshot=snapshot,
            threshold=threshold,
            decay=decay,
            wiring=wiring,
            cells=cells,
            workers=workers,
            deadline=deadline,
        )
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        network.check()
        parts = ["world", *options.host_names(), *(["recorder"] if record else [])]
        with show.progress(screen, "ticks", options.ticks) as on_progress:
            outcome = run_async(
                lambda stop: run_swarm(
                    options,
                    None,
                    stop,
                    on_progress,
                    network=network,
                    swarm=swarm,
                    elsewhere=frozenset(parts),
                    patience=patience,
                )
            )
        show.outcome(say(as_json), options, outcome, None)
        if as_json:
            facts = show.outcome_facts(options, outcome, None)
            # The recording, and whether it is whole, is the recorder's to say.
            kept = {k: v for k, v in facts.items() if k not in ("log", "complete")}
            print_json({"swarm": swarm, **kept})
