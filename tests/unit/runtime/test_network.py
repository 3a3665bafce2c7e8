"""A host needs only the TLS keys of its own parts."""

import shutil
from pathlib import Path

import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.fabric.certificates import make_keys
from neurosnap.fabric.hub_address import AUTHORITY
from neurosnap.fabric.roles import Role
from neurosnap.runtime.network import Connections, Network

WHERE = "tls/127.0.0.1:7447"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("network") / "keys"
    make_keys(folder)
    return folder


def host(keys: Path, folder: Path, *roles: Role) -> str:
    """Return a folder with the files of some roles, as one host has them."""
    folder.mkdir()
    shutil.copy(keys / f"{AUTHORITY}.pem", folder)
    for role in roles:
        for suffix in ("pem", "key"):
            shutil.copy(keys / f"{role}.{suffix}", folder)
    return str(folder)


@pytest.mark.parametrize("role", ["world", "recorder", "cell", "worker"])
def test_a_service_needs_its_own_keys_and_the_watchers(
    role: Role, keys: Path, tmp_path: Path
) -> None:
    tls = host(keys, tmp_path / "here", role, "watcher")
    network = Network(connect=WHERE, tls=tls)
    network.check("watcher")
    connections = Connections(network)
    assert connections.to("watcher", "demo").address.credentials is not None
    who = role if role in ("world", "recorder") else f"{role}/0"
    own = connections.to(who, "demo", 5)
    assert own.address.credentials is not None
    found = own.address.credentials.role, own.address.endpoint, own.first
    assert found == (role, WHERE, 5)
    with pytest.raises(InvalidValueError, match=r"coordinator\.pem: must be a file"):
        network.check()


def test_a_launcher_needs_the_keys_of_the_parts_it_starts(
    keys: Path, tmp_path: Path
) -> None:
    tls = host(keys, tmp_path / "here", "coordinator")
    Network(connect=WHERE, tls=tls).check()
    Network(connect=WHERE, tls=tls).check("coordinator")
    with pytest.raises(InvalidValueError, match=r"world\.pem: must be a file"):
        Network(connect=WHERE, tls=tls).check("coordinator", "world")
    with pytest.raises(InvalidValueError, match=r"hub\.pem: must be a file"):
        Network(listen=WHERE, tls=tls).check()


def test_the_keys_of_a_role_are_read_once(keys: Path, tmp_path: Path) -> None:
    tls = host(keys, tmp_path / "here", "cell")
    connections = Connections(Network(connect=WHERE, tls=tls))
    first = connections.to("cell/0", "demo")
    shutil.rmtree(tls)
    assert (
        connections.to("cell/1", "demo").address.credentials
        is first.address.credentials
    )


def test_without_a_network_parts_meet_on_the_swarms_own_socket() -> None:
    own = Connections(Network(), "unixsock-stream/own").to("world", "demo")
    found = own.address.endpoint, own.address.credentials
    assert found == ("unixsock-stream/own", None)
