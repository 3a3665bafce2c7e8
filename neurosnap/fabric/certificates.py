"""Makes a swarm's TLS keys and certificates, and checks them before any handshake.

They are a private authority and a certificate per role. The folder comes whole or not
at all, and only its owner can look into it. What a part on another machine needs is the
authority's certificate and the two files of its role. The authority's key can make
more; it stays where it was made. Zenoh's side of a refused handshake is a time-out;
here the file and the fault have names.
"""

import ipaddress
import logging
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.hub_address import (
    AUTHORITY,
    Credentials,
    certificate_file,
    key_file,
)
from neurosnap.fabric.roles import ROLES

_LONGEST = 3650  # days
_LONGEST_NAME = 253
_LABEL = r"[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?"
_NAME = re.compile(rf"{_LABEL}(\.{_LABEL})*", re.IGNORECASE)
_HERE = ("localhost", "127.0.0.1", "::1")
_SKEW = timedelta(hours=1)  # how far behind another machine's clock may be


class Made(msgspec.Struct):
    """The files that `make_keys` wrote."""

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
        raise InvalidValueError("keys", "must be in a folder that exists", str(folder))
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


_LOG = logging.getLogger(__name__)
SOON = timedelta(days=30)
"""How long before its end a certificate is warned of."""
_warned: set[Path] = set()


def read_credentials(folder: Path, who: str) -> Credentials:
    """Return the credentials of `who` in a folder that `make_keys` made.

    Warns, once for a folder, of a certificate that expires within 30 days. About half a
    millisecond.

    Args:
        folder: What was made, or the authority's certificate and the two files of the
            role.
        who: A part, ``cell/3``, which has those of its role; or a role.

    Raises:
        InvalidValueError: There is no such role; a file is missing, is not what it must
            be, or may be read or written by others; the certificate is not valid now,
            is another's, was not signed by the authority, or its key is another's.
    """
    found = Credentials.in_folder(folder, who)
    authority = _certificate(Path(found.authority))
    certificate = _certificate(Path(found.certificate))
    key = _key(Path(found.key))
    at = datetime.now(UTC)
    _check_time(found.authority, authority, at)
    _check_time(found.certificate, certificate, at)
    _check_signed(found, certificate, authority)
    _check_name(found, certificate)
    if key.public_key() != certificate.public_key():
        rule = f"must be the key of {found.certificate}"
        raise InvalidValueError(found.key, rule, "another key")
    ends = authority.not_valid_after_utc, certificate.not_valid_after_utc
    _warn(folder, min(ends), at)
    return found


def _warn(folder: Path, until: datetime, now: datetime) -> None:
    """Warn of a certificate that expires soon: one of a folder is enough."""
    if until - now <= SOON and folder not in _warned:
        _warned.add(folder)
        _LOG.warning(
            "keys in %s: expires on %s UTC, in %d days; make new keys with"
            " `neurosnap init keys`",
            folder,
            f"{until:%F %H:%M}",
            max((until - now).days, 0),
        )


def _read(path: Path, forbidden: int, rule: str) -> bytes:
    """Return what is in a file that others cannot do what is `forbidden` with."""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        content = path.read_bytes()
    except OSError as error:
        readable = "must be a file that can be read"
        raise InvalidValueError(str(path), readable, error.strerror) from error
    if mode & forbidden:
        raise InvalidValueError(str(path), rule, f"{mode:04o}")
    return content


def _certificate(path: Path) -> x509.Certificate:
    rule = "must be writable by its owner only (chmod go-w)"
    content = _read(path, stat.S_IWGRP | stat.S_IWOTH, rule)
    try:
        return x509.load_pem_x509_certificate(content)
    except ValueError as error:
        rule = "must be a certificate in PEM"
        raise InvalidValueError(str(path), rule, content[:40]) from error


def _key(path: Path) -> PrivateKeyTypes:
    rule = "must be readable by its owner only (chmod 600)"
    content = _read(path, stat.S_IRWXG | stat.S_IRWXO, rule)
    try:
        return load_pem_private_key(content, None)
    except (ValueError, TypeError):
        # Neither the content nor the cause: both may show what must stay secret.
        rule = "must be a private key in PEM, without a password"
        raise InvalidValueError(str(path), rule, "something else") from None


def _check_time(path: str, certificate: x509.Certificate, now: datetime) -> None:
    since, until = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if not since <= now <= until:
        rule = f"must be valid now, it is from {since:%F %T} to {until:%F %T} UTC"
        raise InvalidValueError(path, rule, f"{now:%F %T}")


def _check_signed(
    found: Credentials, certificate: x509.Certificate, authority: x509.Certificate
) -> None:
    try:
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature) as error:
        rule = f"must be signed by {found.authority}"
        issuer = certificate.issuer.rfc4514_string()
        raise InvalidValueError(found.certificate, rule, issuer) from error


def _check_name(found: Credentials, certificate: x509.Certificate) -> None:
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    shown = [str(name.value) for name in names]
    if shown != [found.role]:
        rule = f"must be for {found.role}"
        raise InvalidValueError(found.certificate, rule, ", ".join(shown))
    wanted = {ExtendedKeyUsageOID.CLIENT_AUTH}
    if found.role == "hub":
        wanted.add(ExtendedKeyUsageOID.SERVER_AUTH)
    try:
        uses = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage)
        given = set(uses.value)
    except x509.ExtensionNotFound:
        given = set()
    if not wanted <= given:
        rule = f"must be made for what {found.role} does with it"
        names_given = sorted(use.dotted_string for use in given)
        raise InvalidValueError(found.certificate, rule, names_given)
