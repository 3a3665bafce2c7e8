"""What the fork server of the tests has loaded: all that any part of a swarm needs.

That of a real run holds what a cell needs, and the coordinator, the world and the
recorder load the rest when they start: a second of work each, in hundreds of swarms.
Runs that tests start by the command line have the real one.
"""

from multiprocessing import forkserver

import world
from neurosnap.record import recorder, resume
from neurosnap.swarm import jobs, outlet, probe, worker
from neurosnap.swarm import world as source

__all__ = ["jobs", "outlet", "probe", "recorder", "resume", "source", "worker", "world"]


def start() -> None:
    """Start the fork server, of which there is one a process."""
    forkserver.set_forkserver_preload([__name__])
    forkserver.ensure_running()
