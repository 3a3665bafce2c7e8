"""Every fabric, and a hub for those that need one."""

import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.support.fabrics import BE_HUB, Hub, MemoryNetwork, Network, ZenohNetwork


@pytest.fixture
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return where a hub can listen; a socket's path must be short."""
    return f"unixsock-stream/{tmp_path_factory.mktemp('n')}/hub"


@pytest.fixture(scope="session")
def hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hub]:
    endpoint = f"unixsock-stream/{tmp_path_factory.mktemp('n')}/hub"
    command = [sys.executable, "-c", BE_HUB, endpoint]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        yield Hub(endpoint, process.pid)
        process.communicate()
    assert process.returncode == 0


@pytest.fixture(
    params=[
        "memory",
        pytest.param("zenoh", marks=pytest.mark.zenoh),
        pytest.param("zenoh-swift", marks=pytest.mark.zenoh),
    ]
)
def network(request: pytest.FixtureRequest) -> Network:
    if request.param == "memory":
        return MemoryNetwork()
    return ZenohNetwork(
        request.getfixturevalue("hub"), swift=request.param == "zenoh-swift"
    )
