"""The network of a swarm: where its hub listens, and how parts connect to it."""

import asyncio
from pathlib import Path
from typing import Annotated

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.fabric.hub_address import (
    Credentials,
    HubAddress,
    check_endpoint,
    nearest,
)
from neurosnap.fabric.roles import Role, role_of
from neurosnap.fabric.zenoh.connect_session import reach
from neurosnap.fabric.zenoh.discovery import Discovery
from neurosnap.protocol.option_declaration import option
from neurosnap.runtime.parts.job import PartConnection


class Network(msgspec.Struct, frozen=True, kw_only=True):
    """The options of a swarm's network.

    By default the hub listens on a socket in a folder that no other user can enter: no
    port is taken, and no other user can connect.
    """

    listen: Annotated[
        str,
        option(
            "Where the hub listens for parts and programs from elsewhere, such as"
            " tcp/127.0.0.1:7447.",
            unit="ENDPOINT",
            default="a private socket on this machine",
        ),
    ] = ""
    connect: Annotated[
        str,
        option(
            "Use the hub that listens there (`neurosnap serve hub`), and start none.",
            unit="ENDPOINT",
        ),
    ] = ""
    tls: Annotated[
        str,
        option(
            "Encrypt, with the keys in this folder (made by `neurosnap init keys DIR`). Each"
            " part may then do no more than its certificate says.",
            unit="DIR",
        ),
    ] = ""
    insecure: Annotated[
        bool,
        option("Allow other machines to connect without encryption and without keys."),
    ] = False

    def check(self, *parts: str) -> None:
        """Refuse options that do not go together, before any part is started.

        Args:
            parts: Whose keys have to be there; none: those that every launcher of a
                run needs, the hub's where it listens and the coordinator's otherwise.

        Raises:
            InvalidValueError: There are two endpoints, or one that may not be used; or
                keys come without one, or are not fit for use.
        """
        if self.listen and self.connect:
            rule = "must not come with an endpoint to listen on"
            raise InvalidValueError("connect", rule, self.connect)
        endpoint = self.listen or self.connect
        if endpoint:
            check_endpoint(endpoint, tls=bool(self.tls), insecure=self.insecure)
            own = "hub" if self.listen else "coordinator"
            for role in sorted({role_of(who) for who in parts or (own,)}):
                self.credentials(role)
        elif self.tls:
            rule = "must come with an endpoint to listen on (--listen tls/HOST:PORT)"
            raise InvalidValueError("tls", rule, self.tls)

    def endpoint(self, role: Role, own: str) -> str:
        """Return where a part listens or connects.

        Args:
            role: The part's; the hub is the one that listens.
            own: The swarm's own socket.
        """
        if self.connect:
            return self.connect
        if not self.listen:
            return own
        return self.listen if role == "hub" else nearest(self.listen)

    def credentials(self, role: Role) -> Credentials | None:
        """Return the credentials of a role; None if there are no keys.

        Raises:
            InvalidValueError: The folder lacks its keys, or they are not fit for use.
        """
        if not self.tls:
            return None
        # Only here: parts are handed paths, and need no cryptography of their own.
        from neurosnap.fabric.certificates import read_credentials

        return read_credentials(Path(self.tls), role)


PRIVATE = Network()
"""A hub that no other user can connect to."""


class Connections:
    """Connections of the parts of one network.

    Args:
        network: Where the hub is.
        own: The swarm's own socket, where it has one.

    Raises:
        InvalidValueError: From any method: keys are not there, or not fit for use.
    """

    def __init__(self, network: Network, own: str = "") -> None:
        self._network = network
        self._own = own
        self._known: dict[Role, Credentials | None] = {}

    def to(self, who: str, swarm: str, first: int = 0) -> PartConnection:
        """Return the connection of a part, its messages numbered from `first`.

        `swarm` is what its swarm is called on the wire.
        """
        return PartConnection(who, swarm, self._hub(who), first)

    async def await_hub(self, stop: asyncio.Event) -> bool:
        """Wait until the hub answers a coordinator, or `stop`; tell whether it did.

        Raises:
            FabricError: It does not.
        """
        session = await reach("coordinator", self._hub("coordinator"), stop)
        if session is None:
            return False
        await asyncio.to_thread(session.close)
        return True

    def discovery(
        self, swarm: str, stop: asyncio.Event, patience: float = 60.0
    ) -> Discovery:
        """Return a lookout for the swarms of an id, to be entered.

        It goes on trying for `patience` seconds until the hub answers, or until `stop`.
        """
        hub = self._hub("watcher")
        return Discovery(swarm, hub, stop=stop, patience=patience)

    def _hub(self, who: str) -> HubAddress:
        """Return where a part finds the hub, and what it shows to it."""
        role = role_of(who)
        if role not in self._known:  # and not read for every cell of a role
            self._known[role] = self._network.credentials(role)
        endpoint = self._network.endpoint(role, self._own)
        return HubAddress(endpoint, self._known[role], self._network.insecure)
