"""The hub: routes messages between a swarm's parts, and can link to other hubs.

Without credentials it stays on this machine; with them every link is mutual TLS, and it
passes on only what `neurosnap.fabric.roles` allows. Each hub holds its own
parts to that, and takes a linked hub's word for the parts of that one.

Zenoh looks for a linked hub that is not there by itself, and does not report it. And it
lets any session be a router's. The access list holds that one to what its certificate
may publish and read; but other hubs send messages for each other through it where that
seems the shorter way, and there the list drops them. So its name is logged.

Zenoh tells in its own log alone which sessions it refuses, and why. An intruder could
fill that log without end, so it is off unless ``RUST_LOG`` turns it on.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import zenoh

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.hub_address import Credentials, check_endpoint, nearest
from neurosnap.fabric.roles import access_list
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.fabric.zenoh.connect_session import absence, configuration, reason_of

_SPARE = 100  # sessions beside those expected: watchers, and parts that come back
_RETRY = {"period_init_ms": 50, "period_max_ms": 1000, "period_increase_factor": 1.5}
_SAID_AFTER = 2.0  # seconds
_DANGER = "what hubs send each other may be lost; make new keys without it"


def open_hub(
    endpoints: Sequence[str],
    sessions: int,
    *,
    links: Sequence[str] = (),
    credentials: Credentials | None = None,
    insecure: bool = False,
) -> zenoh.Session:
    """Open a router that parts of a swarm connect to. Blocks; close it when done.

    Args:
        endpoints: What it listens on.
        sessions: How many parts will connect.
        links: Where other hubs listen. It does not wait for them, and looks for one
            that is not there as long as it is open itself.
        credentials: The hub's; turns on mutual TLS and the access list.
        insecure: May listen, and link, beyond this machine without credentials.

    Raises:
        InvalidValueError: An endpoint breaks the rule of `check_endpoint`, or the hub
            would be linked to itself.
        FabricError: An endpoint is in use or cannot be listened on.
    """
    for endpoint in (*endpoints, *links):
        check_endpoint(endpoint, tls=credentials is not None, insecure=insecure)
    own = {nearest(endpoint) for endpoint in endpoints}
    for link in links:
        if nearest(link) in own:
            raise InvalidValueError("link", "must be where another hub listens", link)
    guard: dict[str, object] = {}
    if credentials is not None:
        guard = {
            "transport__link__tls": credentials.to_listen() | credentials.to_connect(),
            "access_control": access_list(),
        }
    config = configuration(
        "router",
        listen__endpoints=list(endpoints),
        connect__endpoints=list(links),
        connect__timeout_ms=-1,
        connect__exit_on_failure=False,
        connect__retry=_RETRY,
        transport__unicast__max_sessions=sessions + _SPARE,
        transport__unicast__accept_pending=sessions + _SPARE,
        # A stock router shows what it is and who is there to all who connect.
        adminspace__permissions={"read": False, "write": False},
        **guard,
    )
    zenoh.try_init_log_from_env()
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        rule = f"must be able to listen on {', '.join(endpoints)}"
        raise FabricError(f"hub: {rule}, got {reason_of(error)}") from error


async def follow_links(
    session: zenoh.Session,
    links: Sequence[str],
    stop: asyncio.Event,
    report: Callable[[str], None],
    credentials: Credentials | None = None,
) -> None:
    """Report each hub that is linked to this one, or is not any more, until `stop`.

    After two seconds it is reported, once, which hubs are waited for. With credentials
    what is linked and no hub is named.
    """
    loop, changed = asyncio.get_running_loop(), asyncio.Event()

    def on_event(event: zenoh.TransportEvent) -> None:
        if event.transport.whatami == zenoh.WhatAmI.ROUTER:
            loop.call_soon_threadsafe(changed.set)

    listener: Any = session.info.declare_transport_events_listener(
        zenoh.handlers.Callback(on_event, indirect=False)
    )
    there: dict[str, str] = {}
    intruders: set[str] = set()  # by certificate; each is reported once
    try:
        async with asyncio.TaskGroup() as group:
            missing = _report_missing(session, links, stop, report)
            group.create_task(missing, name="hub/missing links")
            while not stop.is_set():
                changed.clear()
                now = {}
                for link in await asyncio.to_thread(_links, session):
                    name = link.auth_identifier
                    if credentials is None or name == "hub":
                        now[str(link.zid)] = str(link.dst)
                    elif name not in intruders:
                        intruders.add(name)
                        report(f"{name} is linked and no hub: {_DANGER}")
                for hub in now.keys() - there.keys():
                    report(f"linked with the hub at {now[hub]}")
                for hub in there.keys() - now.keys():
                    report(f"lost the link with the hub at {there[hub]}")
                there = now
                await wait_any(changed, stop)
    finally:
        await asyncio.to_thread(listener.undeclare)


def _links(session: zenoh.Session) -> list[Any]:
    """Return the connections with other routers that there are now.

    Where the other one connected, its address is that of its end of the connection,
    where nothing listens.
    """
    routers = set(map(str, session.info.routers_zid()))
    return [link for link in session.info.links() if str(link.zid) in routers]


def _address(name: Any) -> str:  # noqa: ANN401
    """Return an end of a connection as Zenoh writes it."""
    if not isinstance(name, tuple):
        return ""
    host, port = name[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


async def _report_missing(
    session: zenoh.Session,
    links: Sequence[str],
    stop: asyncio.Event,
    report: Callable[[str], None],
) -> None:
    await wait_any(stop, seconds=_SAID_AFTER)
    ends = {str(link.dst) for link in await asyncio.to_thread(_links, session)}
    for link in links:
        if not stop.is_set() and ends.isdisjoint(await _addresses(link)):
            report(absence(link))


async def _addresses(endpoint: str) -> set[str]:
    """Return an endpoint, and what Zenoh may call it once its name is looked up."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    found = {endpoint}
    if protocol != "unixsock-stream":
        lookup = asyncio.get_running_loop().getaddrinfo(host.strip("[]"), port)
        with contextlib.suppress(OSError):
            found |= {f"{protocol}/{_address(entry[4])}" for entry in await lookup}
    return found
