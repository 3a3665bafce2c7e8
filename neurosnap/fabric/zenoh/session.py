"""The configuration of every Zenoh session: no multicast, bounded messages."""

import json
from collections.abc import Mapping
from typing import Any

import zenoh

from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.zenoh.pieces import LARGEST

# What is larger is dropped as it comes in: nobody can fill another's memory.
_BOUNDED = {"transport/link/rx/max_message_size": LARGEST}
# A stalled part must not get its link closed and lose what waits: microseconds.
_UNHURRIED = {
    "transport/link/tx/queue/congestion_control/block/wait_before_close": 60_000_000
}


def settings(mode: str, **more: object) -> dict[str, object]:
    """Return Zenoh's keys and values for who listens to nobody and looks for nobody.

    Args:
        mode: ``client`` or ``router``.
        more: More of Zenoh's keys, ``__`` for ``/``; values as JSON can say them.
    """
    defaults: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        # On, no more than some 350 sessions connect to one router.
        "transport/shared_memory/enabled": False,
    }
    named = {key.replace("__", "/"): value for key, value in more.items()}
    return defaults | _BOUNDED | _UNHURRIED | named


def configuration(mode: str, **more: object) -> zenoh.Config:
    """Return `settings` as Zenoh takes them."""
    return zenoh.Config.from_json5(json.dumps(nested(settings(mode, **more))))


def nested(flat: Mapping[str, object]) -> dict[str, Any]:
    """Return Zenoh's keys and values as objects in objects.

    Example:
        >>> nested({"mode": "router", "listen/endpoints": [], "listen/timeout_ms": 0})
        {'mode': 'router', 'listen': {'endpoints': [], 'timeout_ms': 0}}
    """
    document: dict[str, Any] = {}
    for key, value in flat.items():
        *folders, name = key.split("/")
        place = document
        for folder in folders:
            place = place.setdefault(folder, {})
        place[name] = value
    return document


def connecting(
    endpoint: str, patience: float, credentials: Credentials | None = None
) -> zenoh.Config:
    """Return the configuration of a session that connects to a hub.

    Args:
        endpoint: Where the hub listens.
        patience: Seconds to go on trying until it answers.
        credentials: The part's, where the hub has some.
    """
    guard: dict[str, object] = {}
    if credentials is not None:
        guard["transport__link__tls"] = credentials.to_connect()
    return configuration(
        "client",
        connect__endpoints=[endpoint],
        connect__timeout_ms=int(patience * 1000),
        connect__retry={
            "period_init_ms": 50,
            "period_max_ms": 200,
            "period_increase_factor": 1.5,
        },
        **guard,
    )
