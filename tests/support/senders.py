"""Sends readings over Zenoh, as external programs do."""

import json
import threading
from collections.abc import Callable, Mapping
from typing import TypeAlias

import zenoh

from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.zenoh.connect_session import connecting
from tests.support.patience import PATIENCE

Send: TypeAlias = Callable[[Mapping[str, object]], object]
"""Sends a reading, as JSON."""


def by_zenoh(endpoint: str, swarm: str) -> Send:
    """Publish to a swarm, once it listens."""
    session = zenoh.open(connecting(HubAddress(endpoint), PATIENCE))
    publisher = listened_to(session, f"neurosnap/{swarm}/reading")
    # The session is closed with the last reference to it.
    return lambda reading: (publisher.put(json.dumps(reading)), session)


def listened_to(session: zenoh.Session, key: str) -> zenoh.Publisher:
    """Return a stock publisher, once it knows of a listener."""
    # It drops what it cannot send at once, unless it is told not to.
    block = zenoh.CongestionControl.BLOCK
    publisher = session.declare_publisher(key, congestion_control=block)
    matched = threading.Event()

    def note(status: zenoh.MatchingStatus) -> None:
        if status.matching:
            matched.set()

    # It is told at once if there is one already.
    listener = publisher.declare_matching_listener(
        zenoh.handlers.Callback(note, indirect=False)
    )
    assert matched.wait(PATIENCE)
    listener.undeclare()
    return publisher
