"""Without TLS the hub listens only on loopback, unless told otherwise."""

import re

import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.fabric.hub_address import HubAddress, check_endpoint, nearest
from neurosnap.fabric.zenoh.hub import open_hub

HERE = [
    "tcp/127.0.0.1:7447",
    "tcp/127.8.9.1:0",
    "tcp/[::1]:7447",
    "tcp/localhost:7447",
    "unixsock-stream//tmp/x/hub",
]
ELSEWHERE = [
    "tcp/0.0.0.0:7447",
    "tcp/[::]:7447",
    "tcp/192.168.0.7:7447",
    "tcp/hub.example:7447",
    "tcp/127.0.0.1.example:7447",
    "tcp/localhost.example:7447",
    "tcp/127.1:7447",
    "tcp/2130706433:7447",
]
NEVER = [
    "",
    "nonsense",
    "tcp",
    "tcp/",
    "udp/127.0.0.1:7447",
    "quic/127.0.0.1:7447",
    "ws/127.0.0.1:7447",
    "warp/x:1",
    "TCP/127.0.0.1:7447",
    "tcp/127.0.0.1:7447#iface=eth0",
    "tcp/127.0.0.1:7447?rel=1",
]


@pytest.mark.parametrize("endpoint", HERE)
def test_this_machine_needs_no_keys(endpoint: str) -> None:
    check_endpoint(endpoint, tls=False)
    check_endpoint(endpoint, tls=False, insecure=True)


@pytest.mark.parametrize("endpoint", ELSEWHERE)
def test_the_network_needs_keys_or_a_word(endpoint: str) -> None:
    rule = rf"^endpoint: must be .*loopback.*--insecure.*, got '{re.escape(endpoint)}'$"
    with pytest.raises(InvalidValueError, match=rule):
        check_endpoint(endpoint, tls=False)
    check_endpoint(endpoint, tls=False, insecure=True)


@pytest.mark.parametrize("endpoint", NEVER)
@pytest.mark.parametrize("tls", [False, True])
@pytest.mark.parametrize("insecure", [False, True])
def test_what_is_not_known_is_refused(endpoint: str, tls: bool, insecure: bool) -> None:
    with pytest.raises(InvalidValueError, match=r"^endpoint: must be "):
        check_endpoint(endpoint, tls=tls, insecure=insecure)


@pytest.mark.parametrize("endpoint", [*HERE, *ELSEWHERE])
def test_keys_are_never_left_unused(endpoint: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^endpoint: must be tls/"):
        check_endpoint(endpoint, tls=True, insecure=True)


def test_tls_goes_anywhere_and_only_with_keys() -> None:
    check_endpoint("tls/0.0.0.0:7447", tls=True)
    with pytest.raises(InvalidValueError, match=r"^endpoint: must come with keys"):
        check_endpoint("tls/127.0.0.1:7447", tls=False, insecure=True)
    check_endpoint("tls/hub.example:7447", tls=True)
    for never in ("tls/[::1]:7447", "tls/[::]:7447"):
        with pytest.raises(InvalidValueError, match=r"^endpoint: must be tls/NAME"):
            check_endpoint(never, tls=True)
    with pytest.raises(InvalidValueError, match=r"^endpoint: must be PROTOCOL"):
        check_endpoint("tls/127.0.0.1:7447#enable_mtls=false", tls=True)


def test_neither_a_hub_nor_a_part_gets_around_it() -> None:
    with pytest.raises(InvalidValueError, match=r"^endpoint: "):
        open_hub(["tcp/127.0.0.1:0", "tcp/0.0.0.0:0"], 1)
    with pytest.raises(InvalidValueError, match=r"^endpoint: "):
        HubAddress("tcp/hub.example:7447")


@pytest.mark.parametrize(
    ("endpoint", "near"),
    [
        ("tls/0.0.0.0:7447", "tls/127.0.0.1:7447"),
        ("tcp/[::]:7447", "tcp/[::1]:7447"),
        ("tls/hub.example:7447", "tls/hub.example:7447"),
        ("unixsock-stream//tmp/x/hub", "unixsock-stream//tmp/x/hub"),
    ],
)
def test_a_hub_on_every_address_is_reached_over_loopback(
    endpoint: str, near: str
) -> None:
    assert nearest(endpoint) == near
