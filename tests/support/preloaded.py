"""The modules that the tests' fork server preloads for every swarm part.

That of a real run holds what a cell needs, and the coordinator, the world and the
recorder load the rest when they start: a second of work each, in hundreds of swarms.
Runs that tests start by the command line have the real one, except those of
`tests.support.commands`.
"""

from multiprocessing import forkserver

import world
from neurosnap.apps import cli
from neurosnap.apps.config import prepare
from neurosnap.depth import probe
from neurosnap.recording.replay import find_resume_point, verify
from neurosnap.runtime import run_with_intake, run_with_restarts, service
from neurosnap.runtime.parts import (
    coordinator_process,
    recorder_process,
    status_publisher,
    worker_process,
    world_process,
)
from neurosnap.sources.mqtt import mqtt_source
from tests.support.command_line import whole_command

__all__ = [
    "cli",
    "coordinator_process",
    "find_resume_point",
    "mqtt_source",
    "prepare",
    "probe",
    "recorder_process",
    "run_with_intake",
    "run_with_restarts",
    "service",
    "status_publisher",
    "verify",
    "worker_process",
    "world",
    "world_process",
]
whole_command()


def start() -> None:
    """Start the fork server, of which there is one a process."""
    forkserver.set_forkserver_preload([__name__, "tests.support.preloaded_kernels"])
    forkserver.ensure_running()
