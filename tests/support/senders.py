"""Sends readings as external programs do: by a pipe, over Zenoh, or to a broker."""

import json
import threading
import time
from asyncio.subprocess import Process
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

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
    # A stock publisher drops what it cannot send at once, unless it is told not to.
    publisher: Any = session.declare_publisher(
        f"neurosnap/{swarm}/reading", congestion_control=zenoh.CongestionControl.BLOCK
    )
    latest = time.monotonic() + PATIENCE
    while not publisher.matching_status.matching:
        assert time.monotonic() < latest
        time.sleep(0.05)
    # The session is closed with the last reference to it.
    return lambda bits: (publisher.put(json.dumps({"bits": bits})), session)


def by_broker(port: int, topic: str, status: str) -> Send:
    """Publish to a topic, once a run says on another one that it is there."""
    client, listens = Client(CallbackAPIVersion.VERSION2), threading.Event()
    client.on_message = lambda *_: listens.set()
    client.connect("127.0.0.1", port)
    client.subscribe(status, qos=1)
    client.loop_start()
    assert listens.wait(PATIENCE)
    return lambda bits: client.publish(topic, json.dumps(bits), qos=1)
