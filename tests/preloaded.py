"""What the fork server of the tests has loaded: all that any part of a swarm needs.

That of a real run holds what a cell needs, and the coordinator, the world and the
recorder load the rest when they start: a second of work each, in hundreds of swarms.
Runs that tests start by the command line have the real one.
"""

from multiprocessing import forkserver

import world
from neurosnap.depth import probe
from neurosnap.protocol import worker
from neurosnap.recording.replay import resume
from neurosnap.recording.write import recorder
from neurosnap.runtime.parts import (
    coordinator_process,
    status_publisher,
    world_process,
)

__all__ = [
    "coordinator_process",
    "probe",
    "recorder",
    "resume",
    "status_publisher",
    "worker",
    "world",
    "world_process",
]


def start() -> None:
    """Start the fork server, of which there is one a process."""
    forkserver.set_forkserver_preload([__name__])
    forkserver.ensure_running()
