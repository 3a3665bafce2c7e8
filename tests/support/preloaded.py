"""The modules that the tests' fork server preloads for every swarm part.

That of a real run holds what a cell needs, and the coordinator, the world and the
recorder load the rest when they start: a second of work each, in hundreds of swarms.
Runs that tests start by the command line have the real one, except those of
`tests.support.commands`.
"""

from multiprocessing import forkserver

import world
from neurosnap.apps import cli
from neurosnap.apps.cli import output
from neurosnap.apps.config import prepare
from neurosnap.depth import probe
from neurosnap.recording.replay import resume, verify
from neurosnap.runtime import journaled_run, run, service
from neurosnap.runtime.parts import (
    coordinator_process,
    recorder_process,
    status_publisher,
    worker_process,
    world_process,
)
from neurosnap.sources.mqtt import mqtt_source

__all__ = [
    "cli",
    "coordinator_process",
    "journaled_run",
    "mqtt_source",
    "output",
    "prepare",
    "probe",
    "recorder_process",
    "resume",
    "run",
    "service",
    "status_publisher",
    "verify",
    "worker_process",
    "world",
    "world_process",
]


def start() -> None:
    """Start the fork server, of which there is one a process."""
    forkserver.set_forkserver_preload([__name__, "tests.support.preloaded_kernels"])
    forkserver.ensure_running()
