"""The job of a part: what it is given, and what it runs."""

import asyncio
import traceback
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import msgspec

from neurosnap.errors import NeurosnapError, PartDiedError
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.runtime.parts.reports import Reporter

if TYPE_CHECKING:
    from neurosnap.fabric.in_memory import MemoryHub


class PartConnection(msgspec.Struct, frozen=True):
    """Where a part connects to the network, and as which part of which swarm."""

    who: str
    """Its name, as in `Message.sender`."""
    swarm: str
    """The run's id."""
    endpoint: str
    """Where the hub listens."""
    first: int = 0
    """The number of its first message."""
    credentials: Credentials | None = None
    """What it proves itself with."""
    insecure: bool = False
    """It may go over a network without proof."""
    located: bool = False
    """It says where it is, for the swarm is on several machines."""
    local: "MemoryHub | None" = None
    """The network in memory, where all parts are tasks of one loop."""

    def fabric(self, *, swift: bool = False) -> Fabric:
        """Return the part's end of the network, to be entered; see `ZenohFabric`."""
        if self.local is not None:
            return self.local.fabric(self.who, first=self.first)
        return ZenohFabric(
            self.who,
            self.swarm,
            self.endpoint,
            first=self.first,
            swift=swift,
            credentials=self.credentials,
            insecure=self.insecure,
            located=self.located,
        )


@dataclass(frozen=True)
class PartContext:
    """What a part has, whatever its job, and whoever started it."""

    connection: PartConnection
    """Its place on the network."""
    stop: asyncio.Event
    """Set once it is to end in order."""
    reporter: Reporter
    """Its line to whoever started it."""


class Job(Protocol):
    """What a part does, with all it needs: a struct that can be pickled.

    Its class must be importable: the part looks it up by its module.
    """

    async def run(self, part: PartContext) -> None:
        """Work until it is done, or `part.stop` is set."""


async def carry_out(job: Job, part: PartContext) -> bool:
    """Run a job to its end, and report why if it fails; tell whether it did not."""
    try:
        await job.run(part)
    except NeurosnapError as error:
        part.reporter.failed(str(error), died=isinstance(error, PartDiedError))
        return False
    except Exception:  # noqa: BLE001 - the part ends here, and says why
        part.reporter.failed(traceback.format_exc())
        return False
    return True
