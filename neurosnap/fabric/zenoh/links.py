"""Links between hubs: which come and go, and who may be at the other end of one.

Zenoh looks for a hub that is not there by itself, and says nothing of it. And it lets
any session be a router's. The access list holds that one to what its certificate may
say and hear; but other hubs send what is for each other through it where that seems the
shorter way, and there the list drops it. So it is named.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import zenoh

from neurosnap.fabric.events import wait_any, wait_at_most
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.zenoh.reach import absence

_SAID_AFTER = 2.0  # seconds
_DANGER = "what hubs send each other may be lost; make new keys without it"


async def follow_links(
    session: zenoh.Session,
    links: Sequence[str],
    stop: asyncio.Event,
    tell: Callable[[str], None],
    credentials: Credentials | None = None,
) -> None:
    """Tell of each hub that is linked to this one, or is not any more, until `stop`.

    After two seconds it is told, once, which hubs are waited for.

    Args:
        session: The hub's.
        links: Where it looks for others.
        stop: Ends it.
        tell: Gets a line for people.
        credentials: The hub's; anybody linked who is no hub is named.
    """
    loop, changed = asyncio.get_running_loop(), asyncio.Event()

    def note(event: zenoh.TransportEvent) -> None:
        if event.transport.whatami == zenoh.WhatAmI.ROUTER:
            loop.call_soon_threadsafe(changed.set)

    listener: Any = session.info.declare_transport_events_listener(
        zenoh.handlers.Callback(note, indirect=False)
    )
    there: dict[str, str] = {}
    intruders: set[str] = set()  # by certificate; each is told once
    try:
        async with asyncio.TaskGroup() as group:
            missing = _tell_missing(session, links, stop, tell)
            group.create_task(missing, name="hub/missing links")
            while not stop.is_set():
                changed.clear()
                now = {}
                for link in await asyncio.to_thread(_links, session):
                    name = link.auth_identifier
                    if credentials is None or credentials.accepted.get(name) == "hub":
                        now[str(link.zid)] = str(link.dst)
                    elif name not in intruders:
                        intruders.add(name)
                        tell(f"{name} is linked and no hub: {_DANGER}")
                for hub in now.keys() - there.keys():
                    tell(f"linked with the hub at {now[hub]}")
                for hub in there.keys() - now.keys():
                    tell(f"lost the link with the hub at {there[hub]}")
                there = now
                await wait_any(changed, stop)
    finally:
        await asyncio.to_thread(listener.undeclare)


def _links(session: zenoh.Session) -> list[Any]:
    """Return the connections with other routers that there are now.

    Where the other one connected, its address is that of its end of the connection,
    and nobody listens there.
    """
    routers = set(map(str, session.info.routers_zid()))
    return [link for link in session.info.links() if str(link.zid) in routers]


def _address(name: Any) -> str:  # noqa: ANN401
    """Return an end of a connection as Zenoh writes it."""
    if not isinstance(name, tuple):
        return ""
    host, port = name[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


async def _tell_missing(
    session: zenoh.Session,
    links: Sequence[str],
    stop: asyncio.Event,
    tell: Callable[[str], None],
) -> None:
    await wait_at_most(stop, _SAID_AFTER)
    ends = {str(link.dst) for link in await asyncio.to_thread(_links, session)}
    for link in links:
        if not stop.is_set() and ends.isdisjoint(await _addresses(link)):
            tell(await absence(link))


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
