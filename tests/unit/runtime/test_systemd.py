"""A service manager is notified that a run is up, is still running, and ends."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from neurosnap.runtime.systemd import ServiceManager

UP = "READY=1\nWATCHDOG=1\nSTATUS=tick 0"


@pytest.fixture(params=["a file", "no file"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        is_file = request.param == "a file"
        listening.bind(str(tmp_path / "notify") if is_file else "\0neurosnap-notify")
        listening.setblocking(False)
        yield listening


def where(manager: socket.socket) -> str:
    address = manager.getsockname()
    return address if isinstance(address, str) else address.decode().replace("\0", "@")


def heard(manager: socket.socket) -> list[str]:
    said = []
    while True:
        try:
            said.append(manager.recv(4096).decode())
        except BlockingIOError:
            return said


def test_it_is_told_that_the_run_is_up_goes_on_and_ends(
    manager: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", where(manager))
    with ServiceManager() as service:
        assert heard(manager) == []
        service.progress(0)
        service.progress(1)  # not a second later
        assert heard(manager) == [UP]
    assert heard(manager) == ["STOPPING=1"]
    monkeypatch.setenv("WATCHDOG_USEC", "0")
    with ServiceManager() as service:
        service.progress(0)
        service.progress(2)  # as often as a watchdog asks for
        assert heard(manager) == [UP, "WATCHDOG=1\nSTATUS=tick 2"]
        manager.close()  # which is no reason to end
        service.progress(3)
        service.progress(4)


def test_a_run_that_was_started_by_hand_tells_no_manager(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    with ServiceManager() as service:
        service.progress(1)
