"""Connects to a Ray cluster, and asks how many parts it has room for.

Every function blocks, and is called on one thread: what Ray starts for this process
ends with the thread that started it.
"""

import logging
import math
import os
import socket
from collections.abc import Collection
from contextlib import suppress
from typing import NamedTuple

import ray
from ray.util.placement_group import (
    PlacementGroup,
    placement_group,
    remove_placement_group,
)

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.fabric.security.hub_address import stays_here

_ANSWER = 5.0  # seconds in which a cluster must take a connection
_NODE = "ray.io/node-id"


class Node(NamedTuple):
    """A node of the cluster that is alive."""

    id: str
    address: str
    """Of its machine."""
    cpus: float
    """What it has in all, as Ray counts them."""


def connect(address: str) -> bool:
    """Connect this process to a cluster, as `ray.init` finds it.

    What parts log stays in Ray's logs, since with it comes what Ray itself logs.

    Args:
        address: As `ray.init` takes it; empty: that of the environment, or of this
            machine's cluster; where there is none, one is started.

    Returns:
        Whether it was not connected yet: then it is for the caller to leave.

    Raises:
        InvalidValueError: It is no address, or one of Ray's clients.
        SwarmError: No cluster answers there.
    """
    if ray.is_initialized():
        return False
    given = address or os.environ.get("RAY_ADDRESS", "")
    if "://" in given:
        rule = "must be HOST:PORT of a cluster that this machine is a node of"
        raise InvalidValueError("address", rule, given)
    _check_answers(given)
    try:
        ray.init(
            address=given or None,
            include_dashboard=False,
            log_to_driver=False,
            logging_level=logging.CRITICAL,
        )
    except (ConnectionError, RuntimeError, ValueError) as error:
        disconnect()
        raise SwarmError(f"ray: must have a cluster to connect to: {error}") from error
    return True


def _check_answers(given: str) -> None:
    """Refuse a cluster that does not answer: Ray would end the process after a minute.

    Raises:
        InvalidValueError: It is no address.
        SwarmError: No cluster answers.
    """
    from ray._private.services import canonicalize_bootstrap_address

    try:
        found = canonicalize_bootstrap_address(given or None)  # type: ignore[arg-type]
    except ValueError as error:
        rule = "must be HOST:PORT, auto or local"
        raise InvalidValueError("address", rule, given) from error
    except ConnectionError as error:
        rule = "must have a cluster on this machine (start one: ray start --head)"
        raise SwarmError(f"ray: {rule}, found none") from error
    if found is None:
        return  # one will be started
    host, _, port = found.rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _ANSWER):
            return
    except OSError as error:
        rule = f"must have a cluster at {found}, which does not answer ({error})"
        more = "" if given else "; `ray stop` forgets one that has died"
        remedy = (
            "`placement.address` names another one, or local to start one for the run"
        )
        raise SwarmError(f"ray: {rule}: {remedy}{more}") from error


def disconnect() -> None:
    """Leave the cluster, and end it if it was started for this process."""
    ray.shutdown()


def own_node() -> str:
    """Return the id of the node that this process is on."""
    return str(ray.get_runtime_context().get_node_id())


def nodes() -> list[Node]:
    """Return the nodes that are alive."""
    return [
        Node(one["NodeID"], one["NodeManagerAddress"], one["Resources"].get("CPU", 0.0))
        for one in ray.nodes()
        if one["Alive"]
    ]


def check_reach(found: Collection[Node], own: str, endpoint: str) -> None:
    """Refuse a hub that some node cannot reach.

    Args:
        found: The nodes.
        own: The id of this process's.
        endpoint: Where the hub listens; empty for a private socket.

    Raises:
        InvalidValueError: The cluster is on several machines, and it can be reached
            on this one alone.
    """
    machines = {node.address for node in found}
    if len(machines) < 2 or (endpoint and not stays_here(endpoint)):
        return
    here = next((node.address for node in found if node.id == own), "HOST")
    rule = (
        "must be an address of this machine that all nodes reach, such as"
        f" tls/{here}:7447 with --tls DIR: the cluster is on"
        f" {', '.join(sorted(machines))}"
    )
    raise InvalidValueError("listen", rule, endpoint)


def missing(found: Collection[Node], own: str, workers: int) -> str:
    """Return what a cluster lacks for the services and some workers; empty: nothing.

    The services take one CPU of this process's node, and each worker one of any.
    """
    here = next((node.cpus for node in found if node.id == own), 0.0)
    if here < 1:
        return f"1 CPU on this node, for all parts but the workers, has {here:g}"
    room = sum(math.floor(node.cpus) for node in found) - 1
    if room >= workers:
        return ""
    count = "1 node" if len(found) == 1 else f"{len(found)} nodes"
    return (
        f"{workers + 1} CPUs, 1 for each of {workers} workers and 1 for all other"
        f" parts, has {room + 1} on {count}"
    )


def free_cpus() -> float:
    """Return how many CPUs are free."""
    return float(ray.available_resources().get("CPU", 0.0))


def reserve(own: str, workers: int) -> PlacementGroup:
    """Ask for a CPU of a node for the services, and one for each worker, spread."""
    somewhere: list[dict[str, str]] = [{} for _ in range(workers)]
    group: PlacementGroup = placement_group(
        [{"CPU": 1.0}] * (1 + workers),
        strategy="SPREAD",
        bundle_label_selector=[{_NODE: own}, *somewhere],
    )
    return group


def release(group: PlacementGroup) -> None:
    """Give back what was reserved; what still runs there is killed."""
    with suppress(ray.exceptions.RayError):
        remove_placement_group(group)
