"""Sends readings as external programs do: by a pipe, over Zenoh, or to a broker."""

import json
import threading
from asyncio.subprocess import Process
from collections.abc import Callable, Mapping
from typing import TypeAlias

import zenoh
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.zenoh.connect_session import connecting
from tests.support.patience import PATIENCE

Send: TypeAlias = Callable[[Mapping[str, int]], object]
"""Sends a reading of all sensors."""


def by_pipe(process: Process) -> Send:
    """Write lines, each at once: a pipe takes all of it or none."""
    pipe = process.stdin
    assert pipe is not None
    pipe.transport.set_write_buffer_limits(0)
    return lambda bits: pipe.write(json.dumps({"bits": bits}).encode() + b"\n")


def by_zenoh(endpoint: str, swarm: str) -> Send:
    """Publish to a swarm, once it listens."""
    session = zenoh.open(connecting(HubAddress(endpoint), PATIENCE))
    publisher = listened_to(session, f"neurosnap/{swarm}/reading")
    # The session is closed with the last reference to it.
    return lambda bits: (publisher.put(json.dumps({"bits": bits})), session)


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


def by_broker(port: int, topic: str, status: str) -> Send:
    """Publish to a topic, once a run says on another one that it is there."""
    client, listens = Client(CallbackAPIVersion.VERSION2), threading.Event()
    client.on_message = lambda *_: listens.set()
    client.connect("127.0.0.1", port)
    client.subscribe(status, qos=1)
    client.loop_start()
    assert listens.wait(PATIENCE)
    return lambda bits: client.publish(topic, json.dumps(bits), qos=1)
