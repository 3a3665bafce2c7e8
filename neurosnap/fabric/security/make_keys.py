"""Makes a swarm's keys: a private authority, and a certificate per role.

The folder comes whole or not at all, and only its owner can look into it. What a part
on another machine needs is the authority's certificate and the two files of its role.
The authority's key can make more; it stays where it was made.
"""

import ipaddress
import os
import re
import shutil
import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.security.hub_address import AUTHORITY, certificate_file, key_file
from neurosnap.fabric.security.roles import ROLES

_LONGEST = 3650  # days
_LONGEST_NAME = 253
_LABEL = r"[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?"
_NAME = re.compile(rf"{_LABEL}(\.{_LABEL})*", re.IGNORECASE)
_HERE = ("localhost", "127.0.0.1", "::1")
_SKEW = timedelta(hours=1)  # how far behind another machine's clock may be


class Made(msgspec.Struct):
    """What `make_keys` made."""

    folder: str
    roles: tuple[str, ...]
    """Whose certificates there are."""
    hosts: tuple[str, ...]
    """The names and addresses the hub may be reached under."""
    until: datetime
    """When all certificates expire, UTC."""


def make_keys(folder: Path, hosts: Sequence[str] = (), *, days: int = 365) -> Made:
    """Make a private authority and a certificate for every role (EC, P-256).

    Args:
        folder: Where; must not exist yet. It gets mode 0700, its files 0600.
        hosts: Names and addresses the hub is reached under, beside this machine's own.
        days: How long the certificates are valid, in [1, 3650]. They begin an hour
            ago, for clocks that lag.

    Raises:
        InvalidValueError: The folder is there already, or has no parent; a host is no
            name and no address; `days` is out of its range.
        FabricError: The files cannot be written; nothing is left behind.
    """
    if not 1 <= days <= _LONGEST:
        raise InvalidValueError("days", f"must be in [1, {_LONGEST}]", days)
    if os.path.lexists(folder):
        raise InvalidValueError("keys", "must not exist yet", str(folder))
    if not folder.absolute().parent.is_dir():
        rule = "must be in a folder that exists"
        raise InvalidValueError("keys", rule, str(folder))
    hosts = tuple(dict.fromkeys((*_HERE, *hosts)))
    names = [_general_name(host) for host in hosts]
    start = datetime.now(UTC)
    authority = _Authority(start - _SKEW, start + timedelta(days=days))
    files = authority.files()
    for role in ROLES:
        files |= authority.issue(role, names if role == "hub" else ())
    try:
        _write(folder, files)
    except OSError as error:
        raise FabricError(
            f"keys: must be able to write {str(folder)!r}, got {error.strerror}"
        ) from error
    return Made(str(folder), ROLES, hosts, authority.until)


def _general_name(host: str) -> x509.GeneralName:
    """Return `host` as a certificate says it."""
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        if len(host) > _LONGEST_NAME or not _NAME.fullmatch(host):
            rule = "must be a name or an address"
            raise InvalidValueError("host", rule, host) from None
        return x509.DNSName(host)


class _Authority:
    """Signs, with a new key."""

    def __init__(self, since: datetime, until: datetime) -> None:
        self.until = until.replace(microsecond=0)
        self._since = since
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._name = _named("neurosnap authority")

    def files(self) -> dict[Path, bytes]:
        """Return its own files by name."""
        signs = self._builder(self._name, self._key).add_extension(
            x509.BasicConstraints(ca=True, path_length=0), critical=True
        )
        usage = _usage(signs_certificates=True)
        return self._signed(AUTHORITY, self._key, signs.add_extension(usage, True))

    def issue(
        self, role: str, hosts: Sequence[x509.GeneralName] = ()
    ) -> dict[Path, bytes]:
        """Return the files of a role by name.

        Only the hub's certificate lets its owner listen. It connects as well, where
        the hub plays a recording to itself.
        """
        key = ec.generate_private_key(ec.SECP256R1())
        uses = [ExtendedKeyUsageOID.CLIENT_AUTH]
        builder = (
            self._builder(_named(role), key)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), True)
            .add_extension(_usage(signs_certificates=False), True)
        )
        if role == "hub":
            uses.append(ExtendedKeyUsageOID.SERVER_AUTH)
            builder = builder.add_extension(x509.SubjectAlternativeName(hosts), False)
        builder = builder.add_extension(x509.ExtendedKeyUsage(uses), True)
        return self._signed(role, key, builder)

    def _builder(
        self, subject: x509.Name, key: ec.EllipticCurvePrivateKey
    ) -> x509.CertificateBuilder:
        public, authority = key.public_key(), self._key.public_key()
        return (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self._name)
            .public_key(public)
            .serial_number(x509.random_serial_number())
            .not_valid_before(self._since)
            .not_valid_after(self.until)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(authority), False
            )
        )

    def _signed(
        self,
        stem: str,
        key: ec.EllipticCurvePrivateKey,
        builder: x509.CertificateBuilder,
    ) -> dict[Path, bytes]:
        certificate = builder.sign(self._key, SHA256()).public_bytes(Encoding.PEM)
        secret = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
        here = Path()
        return {certificate_file(here, stem): certificate, key_file(here, stem): secret}


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    """Return what a key is for: signing certificates, or handshakes."""
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        encipher_only=False,
        decipher_only=False,
    )


def _write(folder: Path, files: dict[Path, bytes]) -> None:
    """Write all `files` into a new folder, which then appears in one step."""
    # Made with mode 0700, in the same file system, so that it can be renamed.
    draft = Path(tempfile.mkdtemp(prefix=".keys-", dir=folder.absolute().parent))
    try:
        for name, content in files.items():
            _write_file(draft / name, content)
        # Fails if anything was put there meanwhile.
        draft.rename(folder)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def _write_file(path: Path, content: bytes) -> None:
    """Write a file that is not there yet, for its owner alone."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    with os.fdopen(os.open(path, flags, 0o600), "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
