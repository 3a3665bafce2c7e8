"""The hub's list of certificates, by common name.

It stands beside them and is no secret, but whoever can write it lets others in. Zenoh
knows no list of revoked certificates, so this is one of those that are accepted: a
certificate that takes another's place gets a name with the next number (``cell/3#1``),
and the one before is then nobody's. Its owner still gets a session, on which the hub
lets nothing pass.
"""

import stat
from collections.abc import Mapping
from pathlib import Path

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.fabric.security.credentials import NAMES
from neurosnap.fabric.security.roles import role_of


def listed(folder: Path) -> Mapping[str, str] | None:
    """Return the list in a folder of keys; None: there is none.

    So it is where keys were made before there were lists, and on a host that was given
    the files of its own parts alone.

    Raises:
        InvalidValueError: It is not such a list, or may be written by others.
    """
    path = folder / NAMES
    try:
        content = path.read_bytes()
        mode = stat.S_IMODE(path.stat().st_mode)
    except FileNotFoundError:
        return None
    except OSError as error:
        rule = "must be a file that can be read"
        raise InvalidValueError(str(path), rule, error.strerror) from error
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        rule = "must be writable by its owner only (chmod go-w)"
        raise InvalidValueError(str(path), rule, f"{mode:04o}")
    try:
        names = msgspec.json.decode(content, type=dict[str, str])
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        rule = "must hold whose each certificate is"
        raise InvalidValueError(str(path), rule, str(error)) from error
    for name in names.values():
        role_of(name)
    return names


def written(names: Mapping[str, str]) -> bytes:
    """Return a list as the content of its file."""
    return msgspec.json.format(msgspec.json.encode(names)) + b"\n"


def belongs_to(common_name: str, name: str) -> bool:
    """Tell whether a certificate is, or was, one of `name`.

    Example:
        >>> belongs_to("cell/3#2", "cell/3"), belongs_to("cell/31", "cell/3")
        (True, False)
    """
    base, hash_, number = common_name.partition("#")
    return base == name and number.isdecimal() == bool(hash_)


def successor(common_name: str) -> str:
    """Return the common name of the certificate that takes another's place.

    Example:
        >>> successor("cell/3"), successor("cell/3#1")
        ('cell/3#1', 'cell/3#2')
    """
    base, _, number = common_name.partition("#")
    return f"{base}#{int(number or 0) + 1}"
