"""The address of a hub: its endpoint, and the credentials of a part that connects.

Credentials are a certificate, its key, and the authority that is trusted. They are read
and checked once, by what starts the parts; a part only gets the paths.

Without TLS an endpoint is on loopback only. What is not known to stay on this machine
is taken to leave it. Options in an endpoint (after ``?`` or ``#``) are refused: they
could undo what the configuration says.
"""

import ipaddress
from pathlib import Path

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.fabric.roles import Role, role_of

AUTHORITY = "ca"
"""The stem of the authority's files, which stand beside those of the roles."""
_WILDCARDS = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}


class Credentials(msgspec.Struct, frozen=True):
    """A role's private key, its certificate, and the certificate of the authority."""

    role: Role
    """Whose they are: ``cell`` for every cell."""
    authority: str
    """Path of the certificate all others must be signed by."""
    certificate: str
    """Path of the role's certificate."""
    key: str
    """Path of its private key."""

    @classmethod
    def in_folder(cls, folder: Path, who: str) -> "Credentials":
        """Return where `folder` has those of the role of `who`; nothing is read.

        Raises:
            InvalidValueError: There is no such role.
        """
        role = role_of(who)
        return cls(
            role,
            str(certificate_file(folder, AUTHORITY)),
            str(certificate_file(folder, role)),
            str(key_file(folder, role)),
        )

    def to_listen(self) -> dict[str, object]:
        """Return Zenoh's ``transport/link/tls`` for a hub.

        A link is closed when the certificate it was opened with expires.
        """
        return {
            "root_ca_certificate": self.authority,
            "listen_certificate": self.certificate,
            "listen_private_key": self.key,
            "enable_mtls": True,
            "close_link_on_expiration": True,
        }

    def to_connect(self) -> dict[str, object]:
        """Return Zenoh's ``transport/link/tls`` for a client.

        Besides the authority Zenoh's clients believe those that browsers believe, so a
        hub's name should be one that no one else can get a certificate for.
        """
        return {
            "root_ca_certificate": self.authority,
            "connect_certificate": self.certificate,
            "connect_private_key": self.key,
            "enable_mtls": True,
        }


def certificate_file(folder: Path, stem: str) -> Path:
    """Return where the certificate of a role or the authority is."""
    return folder / f"{stem}.pem"


def key_file(folder: Path, stem: str) -> Path:
    """Return where the private key of a role or the authority is."""
    return folder / f"{stem}.key"


class HubAddress(msgspec.Struct, frozen=True):
    """The endpoint of a hub, and the credentials that a part shows to the hub.

    Raises:
        InvalidValueError: The endpoint breaks the rule of `check_endpoint`.
    """

    endpoint: str
    """As Zenoh writes it, ``tls/HOST:PORT``."""
    credentials: Credentials | None = None
    """Of the part that connects; None if the hub asks for none."""
    insecure: bool = False
    """It may be beyond this machine without credentials."""

    def __post_init__(self) -> None:
        tls = self.credentials is not None
        check_endpoint(self.endpoint, tls=tls, insecure=self.insecure)


def check_endpoint(endpoint: str, *, tls: bool, insecure: bool = False) -> None:
    """Refuse to listen or connect where others could listen in.

    Args:
        endpoint: As Zenoh writes it, ``tls/HOST:PORT``.
        tls: There are keys. Then nothing but ``tls/`` is accepted: on any other link
            they would go unused. Not with an IPv6 address, which none could connect to.
        insecure: Any ``tcp/`` endpoint is accepted without keys.

    Raises:
        InvalidValueError: The endpoint breaks the rule.
    """
    protocol, _, rest = endpoint.partition("/")
    if not rest or "?" in rest or "#" in rest:
        raise InvalidValueError("endpoint", "must be PROTOCOL/ADDRESS", endpoint)
    if tls:
        # Zenoh's TLS takes the brackets of an IPv6 address for a part of the name.
        allowed = protocol == "tls" and not rest.startswith("[")
        rule = "must be tls/NAME:PORT or tls/IPV4:PORT where there are keys"
    elif protocol == "tls":
        allowed, rule = False, "must come with keys (--tls)"
    else:
        allowed = protocol == "unixsock-stream" or (
            protocol == "tcp" and (insecure or _is_loopback(rest))
        )
        rule = "must be tcp/ on loopback or unixsock-stream/ without TLS (--insecure)"
        if insecure:
            rule = "must be tcp/HOST:PORT or unixsock-stream/PATH without TLS"
    if not allowed:
        raise InvalidValueError("endpoint", rule, endpoint)


def _is_loopback(address: str) -> bool:
    """Tell whether ``HOST:PORT`` cannot be reached from outside this machine."""
    host, _, _ = address.rpartition(":")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(
            host.removeprefix("[").removesuffix("]")
        ).is_loopback
    except ValueError:
        return False


def stays_here(endpoint: str) -> bool:
    """Tell whether parts that are told this endpoint must be on the hub's own machine.

    So they must where it listens on every address: see `nearest`.
    """
    protocol, _, address = nearest(endpoint).partition("/")
    return protocol == "unixsock-stream" or _is_loopback(address)


def nearest(endpoint: str) -> str:
    """Return how a part on the hub's own machine reaches a hub on `endpoint`.

    No certificate is for "every address", and TLS looks at the name: who listens on
    all of them is reached over loopback.
    """
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if host in _WILDCARDS:
        return f"{protocol}/{_WILDCARDS[host]}:{port}"
    return endpoint
