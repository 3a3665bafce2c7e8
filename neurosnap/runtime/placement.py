"""Where the parts of a swarm are: processes of this machine, or actors on a cluster."""

from importlib.util import find_spec
from typing import Annotated, Literal

import msgspec

from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.protocol.option import option
from neurosnap.protocol.run_options import CellKind
from neurosnap.runtime.network import Network
from neurosnap.runtime.starting.child_processes import ChildProcesses
from neurosnap.runtime.starting.starter import Starter
from neurosnap.system.distribution import must_have


class Placement(msgspec.Struct, frozen=True, kw_only=True):
    """Where the parts are."""

    place: Annotated[
        Literal["here", "ray"],
        option(
            "Where the parts run. Here: as processes of this machine. Ray: as actors on"
            " a Ray cluster, the workers spread over its nodes, all others on this one."
        ),
    ] = "here"
    ray_address: Annotated[
        str,
        option(
            "The Ray cluster: HOST:PORT, auto for the one of this machine, or local to"
            " start one for the run.",
            unit="ADDRESS",
            default="$RAY_ADDRESS, or auto, or local if there is none",
        ),
    ] = ""

    def check(self, cells: CellKind) -> None:
        """Refuse what cannot be placed, before anything is started.

        Raises:
            InvalidValueError: The cells are in no workers; or an address comes without
                a cluster.
        """
        if self.place == "here" and self.ray_address:
            rule = 'must come with place = "ray"'
            raise InvalidValueError("ray_address", rule, self.ray_address)
        if self.place == "ray" and cells != "worker":
            rule = (
                "must be 'worker' with place = \"ray\": an actor takes some 65 MB, 25 threads"
                " and 0.6 s of a processor to start (for cells as processes on several"
                " machines there is `neurosnap serve cells`)"
            )
            raise InvalidValueError("kind", rule, cells)

    def check_installed(self) -> None:
        """Refuse a cluster where the package for it is missing.

        Raises:
            MissingExtraError: It is not installed.
        """
        if self.place == "ray" and find_spec("ray") is None:
            raise MissingExtraError(f"place: {must_have('ray', 'ray')}")

    def starter(self, network: Network, *, again: bool) -> Starter:
        """Return what starts the parts.

        Args:
            network: Where the hub is, which all nodes have to reach.
            again: The run goes on after a death, so a node may be about to come back.
        """
        if self.place == "here":
            return ChildProcesses()
        # Only here: it takes a second to import, and is an extra.
        from neurosnap.runtime.starting.ray_actors import RayActors

        self.check_installed()
        return RayActors(self.ray_address, network, again=again)


HERE = Placement()
"""Every part is a process of this machine."""
