"""Loads a swarm's keys and checks them before any handshake.

Zenoh's side of a refused handshake is a time-out; here the file and the fault have
names.
"""

import logging
import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from neurosnap.errors import InvalidValueError
from neurosnap.fabric.security.hub_address import Credentials

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


def near(until: datetime, now: datetime) -> str:
    """Return what to say of a certificate that expires soon; empty: nothing yet."""
    left = until - now
    if left > SOON:
        return ""
    return (
        f"expires on {until:%F %H:%M} UTC, in {max(left.days, 0)} days; make new keys"
        " with `neurosnap init keys`"
    )


def _warn(folder: Path, until: datetime, now: datetime) -> None:
    """Warn of a certificate that expires soon: one of a folder is enough."""
    text = near(until, now)
    if text and folder not in _warned:
        _warned.add(folder)
        _LOG.warning("keys in %s: %s", folder, text)


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
