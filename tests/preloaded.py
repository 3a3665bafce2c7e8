"""What the fork server of the tests has loaded: all that any part of a swarm needs.

That of a real run holds what a cell needs, and the coordinator, the world and the
recorder load the rest when they start: a second of work each, in hundreds of swarms.
Runs that tests start by the command line have the real one, but for those of
`tests.support.commands`.
"""

from multiprocessing import forkserver

import world
from neurosnap import cli, show
from neurosnap.config import prepare
from neurosnap.outside import mqtt_source
from neurosnap.record import recorder, replay, resume
from neurosnap.swarm import endure, intake, jobs, kept, outlet, probe, service, worker
from neurosnap.swarm import world as source

__all__ = [
    "cli",
    "endure",
    "intake",
    "jobs",
    "kept",
    "mqtt_source",
    "outlet",
    "prepare",
    "probe",
    "recorder",
    "replay",
    "resume",
    "service",
    "show",
    "source",
    "worker",
    "world",
]


def start() -> None:
    """Start the fork server, of which there is one a process."""
    forkserver.set_forkserver_preload([__name__])
    forkserver.ensure_running()
