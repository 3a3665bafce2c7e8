"""The hub: the one router that all parts of a swarm connect to.

Without credentials it stays on this machine; with them every link is mutual TLS, and it
passes on only what `neurosnap.fabric.security.roles` allows.
"""

import re
from collections.abc import Sequence

import zenoh

from neurosnap.errors import FabricError
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.security.endpoint import check_endpoint
from neurosnap.fabric.security.roles import EVERY_ROLE, access_list
from neurosnap.fabric.zenoh.session import configuration

_SOURCE = re.compile(r" at /\S+\.rs:\d+")  # places in the engine's own code
_SPARE = 100  # sessions beside those expected: whoever looks on, or comes back


def open_hub(
    endpoints: Sequence[str],
    sessions: int,
    *,
    credentials: Credentials | None = None,
    insecure: bool = False,
) -> zenoh.Session:
    """Open the router all parts of a swarm connect to. Blocks; close it when done.

    Args:
        endpoints: What it listens on.
        sessions: How many parts will connect.
        credentials: The hub's; turns on mutual TLS and the access list.
        insecure: May listen beyond this machine without credentials.

    Raises:
        InvalidValueError: An endpoint breaks the rule of `check_endpoint`.
        FabricError: An endpoint is in use or cannot be listened on.
    """
    for endpoint in endpoints:
        check_endpoint(endpoint, tls=credentials is not None, insecure=insecure)
    guard: dict[str, object] = {}
    if credentials is not None:
        guard = {
            "transport__link__tls": credentials.to_listen(),
            "access_control": access_list(credentials.accepted or EVERY_ROLE),
        }
    try:
        return zenoh.open(
            configuration(
                "router",
                listen__endpoints=list(endpoints),
                transport__unicast__max_sessions=sessions + _SPARE,
                transport__unicast__accept_pending=sessions + _SPARE,
                **guard,
            )
        )
    except zenoh.ZError as error:
        rule = f"must be able to listen on {', '.join(endpoints)}"
        got = _SOURCE.sub("", str(error))
        raise FabricError(f"hub: {rule}, got {got}") from error
