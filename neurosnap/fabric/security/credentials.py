"""Credentials of a part: its certificate, its key, and the authority it trusts.

Read and checked once, by what starts the parts; a part only gets the paths.
"""

from collections.abc import Mapping
from pathlib import Path

import msgspec

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.fabric.security.roles import role_of

AUTHORITY = "ca"
"""The stem of the authority's files, which stand beside those of roles and parts."""
NAMES = "names.json"
"""The file beside them that says which certificates a hub accepts."""


class Credentials(msgspec.Struct, frozen=True):
    """A part's key, or its role's, the certificate for it, and the authority's."""

    name: str
    """Whose they are: ``cell/3``, or ``cell`` for every cell."""
    authority: str
    """Path of the certificate all others must be signed by."""
    certificate: str
    """Path of the part's certificate."""
    key: str
    """Path of its private key."""
    accepted: Mapping[str, str] = {}
    """For a hub, whose each certificate is that it accepts, by its common name."""

    @classmethod
    def in_folder(cls, folder: Path, who: str) -> "Credentials":
        """Return where `folder` has those of `who`, or of its role; nothing is read."""
        name = holder(folder, who)
        return cls(
            name,
            str(certificate_file(folder, AUTHORITY)),
            str(certificate_file(folder, name)),
            str(key_file(folder, name)),
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


def holder(folder: Path, who: str) -> str:
    """Return whose certificate a part shows: its own where there is one, or its role's.

    Args:
        folder: Of keys.
        who: A part, or a role.

    Raises:
        InvalidValueError: It is of no role.
    """
    role = role_of(who)
    if not wire.is_part(who):  # it would be a path to somewhere else
        raise InvalidValueError("part", "must be like cell/3", who)
    return who if certificate_file(folder, who).exists() else role


def certificate_file(folder: Path, stem: str) -> Path:
    """Return where the certificate of a part, a role or the authority is."""
    return folder / f"{stem}.pem"


def key_file(folder: Path, stem: str) -> Path:
    """Return where the private key of a part, a role or the authority is."""
    return folder / f"{stem}.key"
