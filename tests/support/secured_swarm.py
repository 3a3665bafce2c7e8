"""A run whose parts connect to a hub under TLS, each with the keys of its role."""

import asyncio
from pathlib import Path

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.runtime.network import Network
from neurosnap.runtime.request import RunRequest, Site
from neurosnap.runtime.run import run
from neurosnap.sources.open import open_source
from tests.support.secured_hub import SWARM, Hub

TICKS = 12


async def run_swarm(hub: Hub, options: RunOptions, log: Path) -> Completeness:
    """Run a swarm of processes over `hub`."""
    network = Network(connect=hub.endpoint, tls=str(hub.keys))
    request = RunRequest(options, log, site=Site(network, swarm=SWARM))
    balance = (await run(request, asyncio.Event())).completeness
    assert balance is not None
    return balance


def options() -> RunOptions:
    source = open_source("neurosnap/Path-v0", 2)
    source.close()
    return RunOptions(
        source="neurosnap/Path-v0",
        body=Body(own=source.sensors, actions=source.actions),
        ticks=TICKS,
        seed=2,
        threshold=0.1,
        keyframe_every=5,
    )
