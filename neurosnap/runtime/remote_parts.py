"""Makes the parts that another host adds to a swarm, from the run's description.

Each is made from the coordinator's description of the run, and from what its own host
alone can know.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

from neurosnap.errors import InvalidValueError
from neurosnap.runtime.parts.coordinator_process import RunDescription
from neurosnap.runtime.parts.hub_and_cell import CellJob
from neurosnap.runtime.parts.job import Job
from neurosnap.runtime.parts.recorder_process import RecorderJob
from neurosnap.runtime.parts.worker_process import WorkerJob
from neurosnap.runtime.parts.world_process import WorldJob
from neurosnap.runtime.recorded_source import Trust, reopened

_RANGE = re.compile(r"(\d{1,6})(?:-(\d{1,6}))?", re.ASCII)
"""A number or a range. No swarm has a million cells, and a list of them takes room."""


def among(numbers: Sequence[int], name: str, count: int) -> Sequence[int]:
    """Return some numbers, ascending, which must be of what there is.

    Args:
        numbers: From `parse_ranges`.
        name: What they are of: cells, workers.
        count: How many there are.

    Raises:
        InvalidValueError: One is of none that there is.
    """
    if not count:
        raise InvalidValueError(name, f"must go with a swarm that has {name}", numbers)
    if numbers[-1] >= count:
        rule = f"must be {name} of the swarm, 0 to {count - 1}"
        raise InvalidValueError(name, rule, numbers[-1])
    return numbers


def parse_ranges(name: str, text: str) -> list[int]:
    """Return the numbers in ``0-3,7``, ascending; `name` says of what in an error.

    Raises:
        InvalidValueError: It holds something else, or a number twice.
    """
    numbers: set[int] = set()
    for part in text.split(","):
        match = _RANGE.fullmatch(part.strip())
        some = range(int(match[1]), int(match[2] or match[1]) + 1) if match else ()
        if not some:
            rule = "must be like 0-499 or 3,7,9-12, of at most six digits"
            raise InvalidValueError(name, rule, text)
        if not numbers.isdisjoint(some):
            raise InvalidValueError(name, "must name each once", text)
        numbers.update(some)
    return sorted(numbers)


class RemotePart(NamedTuple):
    """A part that joins a swarm from another host."""

    who: str
    """Its name."""
    job: Job
    lingers: bool = False
    """It ends by itself, once it has heard the others' last words."""


ChooseParts: TypeAlias = Callable[[str, RunDescription], Sequence[RemotePart]]
"""Returns the parts a host starts in the swarm of a name; raises `InvalidValueError`
where the run is not one for it. May block."""


def cells(numbers: Sequence[int]) -> ChooseParts:
    """Return what chooses some cells, a process each, or some of the run's workers.

    There is a cell for every sensor that may still be grown, too.
    """

    def choose(_: str, description: RunDescription) -> list[RemotePart]:
        options = description.options
        if not options.sharing:
            chosen = among(numbers, "cells", len(options.sensors))
            return [RemotePart(f"cell/{n}", CellJob(n)) for n in chosen]
        learning = options if options.learning_shares else None
        common = len(options.sensors), options.sharing, learning
        chosen = among(numbers, "workers", options.sharing)
        return [RemotePart(f"worker/{n}", WorkerJob(n, *common)) for n in chosen]

    return choose


def world(named: Trust) -> ChooseParts:
    """Return what chooses a world: what to open on this host, and with what."""

    def choose(_: str, description: RunDescription) -> list[RemotePart]:
        options, _length = reopened(description.options, named)
        return [RemotePart("world", WorldJob(options, description.past))]

    return choose


def recorder(new_log: Callable[[], Path]) -> ChooseParts:
    """Return what chooses a recorder; `new_log` gives each swarm a place to record."""

    def choose(swarm: str, description: RunDescription) -> list[RemotePart]:
        options = description.options
        heard = ("coordinator", "world", *options.host_names())
        job = RecorderJob(options, str(new_log()), None, swarm, heard)
        return [RemotePart("recorder", job, lingers=True)]

    return choose
