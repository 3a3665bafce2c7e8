"""A hub under mutual TLS, in its own process, which says what it refused."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import zenoh

from neurosnap.fabric.hub_address import Credentials, HubAddress
from neurosnap.fabric.roles import Role
from neurosnap.fabric.zenoh.connect_session import configuration
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.recording.format.completeness import Completeness
from neurosnap.runtime.network import Network
from neurosnap.runtime.request import RunRequest, Site
from neurosnap.runtime.run_with_restarts import run
from tests.support.fabrics import hub_process
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.run_options import options_for

INTRUSION = 1.0  # seconds an intruder goes on trying
SWARM = "one"


class Hub:
    """A hub under TLS, and once it has ended, what it refused."""

    def __init__(self, endpoint: str, keys: Path, pid: int) -> None:
        self.endpoint = endpoint
        self.keys = keys
        self.pid = pid
        self.refused: list[str] = []

    def end(self, who: str, role: Role | None = None) -> ZenohFabric:
        """Return an end with the certificate of `role`, by default the right one."""
        own = who if role is None else role
        return self.end_with(who, Credentials.in_folder(self.keys, own))

    def session(self, mode: str = "client") -> zenoh.Session:
        """Return a session with a cell's certificate, and nothing of ours in it."""
        tls = Credentials.in_folder(self.keys, "cell").to_connect()
        config = configuration(
            mode, connect__endpoints=[self.endpoint], transport__link__tls=tls
        )
        return zenoh.open(config)

    def end_with(
        self, who: str, credentials: Credentials, patience: float = PATIENCE
    ) -> ZenohFabric:
        address = HubAddress(self.endpoint, credentials)
        return ZenohFabric(who, SWARM, address, patience=patience)


@contextmanager
def hub_with(keys: Path, *links: Hub) -> Iterator[Hub]:
    where = f"tls/127.0.0.1:{free_port()}"
    ends = [other.endpoint for other in links]
    with hub_process(where, *ends, keys=keys, log="zenoh_link=warn") as (pid, said):
        hub = Hub(where, keys, pid)
        yield hub
    hub.refused = said


async def run_swarm(hub: Hub, log: Path, ticks: int, **more: object) -> Completeness:
    """Run a swarm of processes over a hub, each with the keys of its role."""
    given = {"ticks": ticks, "threshold": 0.1, "keyframe_every": 5, **more}
    options = options_for("neurosnap/Path-v0", 2, **given)  # type: ignore[arg-type]
    network = Network(connect=hub.endpoint, tls=str(hub.keys))
    request = RunRequest(options, log, site=Site(network, swarm=SWARM))
    balance = (await run(request, asyncio.Event())).completeness
    assert balance is not None
    return balance
