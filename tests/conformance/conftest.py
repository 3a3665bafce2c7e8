"""Every fabric, and a hub for those that need one."""

import asyncio
from collections.abc import Iterator

import pytest

from tests.support.fabrics import (
    Hub,
    MemoryNetwork,
    Network,
    ZenohNetwork,
    are_one_network,
    hub_in_process,
)


@pytest.fixture
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return where a hub can listen; a socket's path must be short."""
    return f"unixsock-stream/{tmp_path_factory.mktemp('n')}/hub"


@pytest.fixture(scope="session")
def hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hub]:
    endpoint = f"unixsock-stream/{tmp_path_factory.mktemp('n')}/hub"
    with hub_in_process(endpoint) as hub:
        yield hub


@pytest.fixture(scope="session")
def linked_hubs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Hub, Hub]]:
    """The ends of a line of three hubs."""
    folder = tmp_path_factory.mktemp("n")
    at = [f"unixsock-stream/{folder}/{name}" for name in "abc"]
    with (
        hub_in_process(at[0]) as near,
        hub_in_process(at[1], at[0]),
        hub_in_process(at[2], at[1]) as far,
    ):
        asyncio.run(are_one_network(near.end, far.end))
        yield near, far


@pytest.fixture(
    params=[
        "memory",
        pytest.param("zenoh", marks=pytest.mark.zenoh),
        pytest.param("zenoh-swift", marks=pytest.mark.zenoh),
        pytest.param("zenoh-linked", marks=[pytest.mark.zenoh, pytest.mark.slow]),
    ]
)
def network(request: pytest.FixtureRequest) -> Network:
    if request.param == "memory":
        return MemoryNetwork()
    if request.param == "zenoh-linked":
        near, far = request.getfixturevalue("linked_hubs")
        return ZenohNetwork(near, swift=False, far=far)
    return ZenohNetwork(
        request.getfixturevalue("hub"), swift=request.param == "zenoh-swift"
    )
