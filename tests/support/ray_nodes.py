"""A Ray cluster of several nodes on this machine.

Every node listens on 127.0.0.1 alone, and nothing is reported to anybody.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import psutil
from ray.cluster_utils import Cluster

from tests.support.patience import PATIENCE


class Nodes:
    """A cluster, whose first node is this process's."""

    def __init__(self, *cpus: int) -> None:
        self._cluster = Cluster()
        self._nodes = [
            self._cluster.add_node(
                num_cpus=count, node_ip_address="127.0.0.1", include_dashboard=False
            )
            for count in cpus
        ]

    @property
    def address(self) -> str:
        return str(self._cluster.address)

    def id(self, number: int) -> str:
        return str(self._nodes[number].node_id)

    def kill(self, number: int) -> None:
        """Kill a node, as if its machine had lost its power."""
        self._cluster.remove_node(self._nodes[number], allow_graceful=False)

    def close(self) -> None:
        self._cluster.shutdown()


@contextmanager
def ray_nodes(*cpus: int) -> Iterator[Nodes]:
    """Start a node for each number of CPUs; end all that are left."""
    nodes = Nodes(*cpus)
    try:
        yield nodes
    finally:
        nodes.close()


def actors() -> list[psutil.Process]:
    """Return the processes of parts that Ray runs on this machine."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.name() == "ray::RayPart":
                found.append(process)
        except psutil.Error:
            continue  # it has ended meanwhile
    return found


def actors_are_gone() -> bool:
    """Wait until no part is left."""
    _, alive = psutil.wait_procs(actors(), timeout=PATIENCE)
    return not alive
