"""What a part shows to prove its role, and whom it believes: paths to three files.

Read and checked once, by whoever starts the parts; a part only gets the paths.
"""

from pathlib import Path

import msgspec

from neurosnap.fabric.access import Role

AUTHORITY = "ca"
"""The stem of the authority's files, which stand beside those of the roles."""


class Credentials(msgspec.Struct, frozen=True):
    """One role's key, its certificate, and the authority's."""

    role: Role
    """The certificate's common name."""
    authority: str
    """Path of the certificate all others must be signed by."""
    certificate: str
    """Path of the role's certificate."""
    key: str
    """Path of its private key."""

    @classmethod
    def in_folder(cls, folder: Path, role: Role) -> "Credentials":
        """Return where `folder` has those of `role`; nothing is read."""
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
        hub's name should be one that nobody else can get a certificate for.
        """
        return {
            "root_ca_certificate": self.authority,
            "connect_certificate": self.certificate,
            "connect_private_key": self.key,
            "enable_mtls": True,
        }


def certificate_file(folder: Path, stem: str) -> Path:
    """Return where the certificate of a role, or of the authority, is."""
    return folder / f"{stem}.pem"


def key_file(folder: Path, stem: str) -> Path:
    """Return where the private key of a role, or of the authority, is."""
    return folder / f"{stem}.key"
