"""The connections of parts to one network; shared keys are read once."""

import asyncio

from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.security.roles import Role, role_of
from neurosnap.fabric.zenoh.discovery import Discovery
from neurosnap.fabric.zenoh.reach import reach
from neurosnap.runtime.network import Network
from neurosnap.runtime.parts.job import PartConnection


class Connections:
    """Connections of the parts of one network.

    Args:
        network: Where the hub is.
        own: The swarm's own socket, where it has one.
        located: The swarm is on several machines, and its parts say where they are.
    """

    def __init__(
        self, network: Network, own: str = "", *, located: bool = False
    ) -> None:
        self._network = network
        self._own = own
        self._located = located
        self._known: dict[str, Credentials | None] = {}

    def to(self, who: str, swarm: str, first: int = 0) -> PartConnection:
        """Return the connection of a part.

        Args:
            who: Its name.
            swarm: What its swarm is called on the wire.
            first: The number of its first message.

        Raises:
            InvalidValueError: Its keys are not there, or not fit for use.
        """
        role = role_of(who)
        return PartConnection(
            who,
            swarm,
            self._network.endpoint(role, self._own),
            first,
            self._credentials(who),
            self._network.insecure,
            self._located,
        )

    async def await_hub(self, stop: asyncio.Event) -> bool:
        """Wait until the hub answers a coordinator, or `stop`; tell whether it did.

        Raises:
            FabricError: It does not.
            InvalidValueError: As from `to`.
        """
        who: Role = "coordinator"
        endpoint = self._network.endpoint(who, self._own)
        session = await reach(who, endpoint, stop, self._credentials(who))
        if session is None:
            return False
        await asyncio.to_thread(session.close)
        return True

    def discovery(
        self, swarm: str, stop: asyncio.Event, patience: float = 60.0
    ) -> Discovery:
        """Return a lookout for the swarms of an id, to be entered.

        Args:
            swarm: The id.
            stop: Ends the wait for the hub.
            patience: Seconds to go on trying until the hub answers.

        Raises:
            InvalidValueError: As from `to`.
        """
        return Discovery(
            swarm,
            self._network.endpoint("watcher", self._own),
            stop=stop,
            credentials=self._credentials("watcher"),
            insecure=self._network.insecure,
            patience=patience,
        )

    def _credentials(self, who: str) -> Credentials | None:
        name = self._network.holder(who)
        if name not in self._known:  # and not read for every cell of a role
            self._known[name] = self._network.credentials(name)
        return self._known[name]
