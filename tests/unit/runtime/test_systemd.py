import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from neurosnap.runtime.systemd import ServiceManager


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.setblocking(False)
        yield listening


def heard(manager: socket.socket) -> list[str]:
    said = []
    while True:
        try:
            said.append(manager.recv(4096).decode())
        except BlockingIOError:
            return said


def test_it_is_told_that_the_run_is_up_goes_on_and_ends(manager: socket.socket) -> None:
    with ServiceManager({"NOTIFY_SOCKET": manager.getsockname()}) as service:
        assert heard(manager) == []
        service.progress(0)
        service.progress(1)  # not a second later
        assert heard(manager) == ["READY=1\nWATCHDOG=1\nSTATUS=tick 0"]
    assert heard(manager) == ["STOPPING=1"]


def test_a_watchdog_is_told_as_often_as_it_asks_for(manager: socket.socket) -> None:
    environment = {"NOTIFY_SOCKET": manager.getsockname(), "WATCHDOG_USEC": "0"}
    with ServiceManager(environment) as service:
        service.progress(1)
        service.progress(2)
        assert heard(manager)[1] == "WATCHDOG=1\nSTATUS=tick 2"


def test_who_was_started_by_hand_tells_nobody() -> None:
    with ServiceManager({}) as service:
        service.progress(1)


def test_a_manager_that_is_gone_is_no_reason_to_end(manager: socket.socket) -> None:
    with ServiceManager({"NOTIFY_SOCKET": manager.getsockname()}) as service:
        manager.close()
        service.progress(1)
        service.progress(2)


def test_an_address_may_be_outside_the_file_system() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind("\0neurosnap-test-notify")
        with ServiceManager({"NOTIFY_SOCKET": "@neurosnap-test-notify"}) as service:
            service.progress(3)
        assert listening.recv(100) == b"READY=1\nWATCHDOG=1\nSTATUS=tick 3"
