"""The hub: a router that parts of a swarm connect to, linked to others or alone.

Without credentials it stays on this machine; with them every link is mutual TLS, and it
passes on only what `neurosnap.fabric.security.roles` allows. Each hub holds its own
parts to that, and takes a linked hub's word for the parts of that one.
"""

import json
import re
from collections.abc import Sequence
from typing import Any

import zenoh

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.security.endpoint import check_endpoint, nearest
from neurosnap.fabric.security.roles import EVERY_ROLE, access_list
from neurosnap.fabric.zenoh.session import nested, settings

_SOURCE = re.compile(r" at /\S+\.rs:\d+")  # places in the engine's own code
_SPARE = 100  # sessions beside those expected: whoever looks on, or comes back
_RETRY = {"period_init_ms": 50, "period_max_ms": 1000, "period_increase_factor": 1.5}


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
    document = hub_document(
        endpoints, sessions, links=links, credentials=credentials, insecure=insecure
    )
    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(document)))
    except zenoh.ZError as error:
        rule = f"must be able to listen on {', '.join(endpoints)}"
        got = _SOURCE.sub("", str(error))
        raise FabricError(f"hub: {rule}, got {got}") from error


def hub_document(
    endpoints: Sequence[str],
    sessions: int,
    *,
    links: Sequence[str] = (),
    credentials: Credentials | None = None,
    insecure: bool = False,
) -> dict[str, Any]:
    """Return the configuration of a hub, as any Zenoh router reads it from a file.

    Args and Raises: As `open_hub`; nothing is opened.
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
            "access_control": access_list(credentials.accepted or EVERY_ROLE),
        }
    return nested(
        settings(
            "router",
            listen__endpoints=list(endpoints),
            connect__endpoints=list(links),
            connect__timeout_ms=-1,
            connect__exit_on_failure=False,
            connect__retry=_RETRY,
            transport__unicast__max_sessions=sessions + _SPARE,
            transport__unicast__accept_pending=sessions + _SPARE,
            # A stock router shows what it is and who is there to whoever connects.
            adminspace__permissions={"read": False, "write": False},
            **guard,
        )
    )
