"""Keys are written atomically and checked before use."""

import os
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from shutil import copytree
from types import SimpleNamespace
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric import certificates as making
from neurosnap.fabric.certificates import make_keys, read_credentials
from neurosnap.fabric.hub_address import Credentials
from neurosnap.fabric.roles import ROLES


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of all roles, and another authority's: only to be read."""
    folder = tmp_path_factory.mktemp("made")
    make_keys(folder / "keys", ["hub.example", "192.168.0.7"])
    make_keys(folder / "other")
    return folder


@pytest.fixture
def keys(made: Path, tmp_path: Path) -> Path:
    return copytree(made / "keys", tmp_path / "keys")


def certificate(folder: Path, stem: str) -> x509.Certificate:
    return x509.load_pem_x509_certificate((folder / f"{stem}.pem").read_bytes())


def let_be(now: datetime, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let it be a time, for who makes keys and who reads them."""
    monkeypatch.setattr(making, "datetime", SimpleNamespace(now=lambda _: now))


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


# Making -------------------------------------------------------------------------------


def test_each_role_has_a_certificate_that_says_what_it_is_for(made: Path) -> None:
    folder = made / "keys"
    stems, authority = ("ca", *ROLES), certificate(folder, "ca")
    wanted = {f"{stem}{end}" for stem in stems for end in (".pem", ".key")}
    assert {path.name for path in folder.iterdir()} == wanted
    numbers = set()
    for stem in stems:
        key = load_pem_private_key((folder / f"{stem}.key").read_bytes(), None)
        assert isinstance(key, ec.EllipticCurvePrivateKey)
        assert isinstance(key.curve, ec.SECP256R1)
        assert key.public_key() == certificate(folder, stem).public_key()
        numbers.add(key.public_key().public_numbers())
    assert len(numbers) == len(stems)
    for role in ROLES:
        found = certificate(folder, role)
        assert found.subject.rfc4514_string() == f"CN={role}"
        found.verify_directly_issued_by(authority)
        extensions = found.extensions
        assert not extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        usage = extensions.get_extension_for_class(x509.KeyUsage).value
        assert usage.digital_signature
        assert not usage.key_cert_sign
        uses = set(extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)
        assert ExtendedKeyUsageOID.CLIENT_AUTH in uses
        assert (ExtendedKeyUsageOID.SERVER_AUTH in uses) == (role == "hub")
    names = (
        certificate(folder, "hub")
        .extensions.get_extension_for_class(x509.SubjectAlternativeName)
        .value
    )
    assert names.get_values_for_type(x509.DNSName) == ["localhost", "hub.example"]
    addresses = names.get_values_for_type(x509.IPAddress)
    assert [str(each) for each in addresses] == ["127.0.0.1", "::1", "192.168.0.7"]


def test_only_the_owner_can_look_whatever_the_umask_and_for_so_many_days(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, before = datetime(2030, 5, 1, 12, tzinfo=UTC), os.umask(0)
    try:
        let_be(now, monkeypatch)
        made = make_keys(tmp_path / "keys", days=3)
    finally:
        os.umask(before)
    assert [path.name for path in tmp_path.iterdir()] == ["keys"]
    assert mode(tmp_path / "keys") == 0o700
    assert {mode(path) for path in (tmp_path / "keys").iterdir()} == {0o600}
    assert made.until == now + timedelta(days=3)
    for stem in ("ca", *ROLES):
        found = certificate(tmp_path / "keys", stem)
        assert found.not_valid_after_utc == made.until
        assert found.not_valid_before_utc == now - timedelta(hours=1)


def test_what_is_there_stays_as_it_is(keys: Path, tmp_path: Path) -> None:
    before = {path: path.read_bytes() for path in keys.iterdir()}
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for folder in (keys, tmp_path / "link"):
        rule = rf"^keys: must not exist yet, got '{re.escape(str(folder))}'$"
        with pytest.raises(InvalidValueError, match=rule):
            make_keys(folder)
    assert {path: path.read_bytes() for path in keys.iterdir()} == before


def test_a_disk_that_fails_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[int] = []

    def fail(descriptor: int) -> None:
        done.append(descriptor)
        if len(done) == 5:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(FabricError, match=r"^keys: must be able to write .*No space"):
        make_keys(tmp_path / "keys")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("given", "rule"),
    [
        *[
            ({"days": days}, rf"^days: must be in \[1, 3650\], got {days}$")
            for days in (0, -1, 3651)
        ],
        *[
            ({"hosts": [host]}, r"^host: must be a name or an address")
            for host in (
                "",
                "a b",
                "-a",
                "*.example",
                "a/b",
                "a..b",
                "hub:7447",
                "x" * 64,
            )
        ],
        ({"folder": "a/keys"}, r"^keys: must be in a folder that"),
    ],
)
def test_what_cannot_be_made_is_refused(
    given: dict[str, Any], rule: str, tmp_path: Path
) -> None:
    folder = tmp_path / given.pop("folder", "keys")
    with pytest.raises(InvalidValueError, match=rule):
        make_keys(folder, **given)
    assert list(tmp_path.iterdir()) == []


# Reading ------------------------------------------------------------------------------


NONSENSE = b"-----BEGIN NONSENSE-----\n"
MISSING = "must be a file that can be read, got 'No such"
PEM = "must be a certificate in PEM"
CLOSED = "must be readable by its owner only.*got "
OTHERS = "must be writable by its owner only"


@pytest.mark.parametrize(
    ("name", "becomes", "rule"),
    [
        *[(name, None, MISSING) for name in ("ca.pem", "cell.pem", "cell.key")],
        *[
            ("cell.key", m, CLOSED + f"'{m:04o}'$")
            for m in (0o640, 0o604, 0o620, 0o601)
        ],
        *[(name, 0o664, OTHERS) for name in ("ca.pem", "cell.pem")],
        *[(name, NONSENSE, PEM) for name in ("ca.pem", "cell.pem")],
        ("cell.key", NONSENSE, "must be a private key in PEM, .*, got 'someth"),
        ("cell.pem", "../other/cell.pem", "must be signed by .*/ca.pem, got "),
        ("cell.pem", "world.pem", "must be for cell, got 'world'$"),
        ("cell.key", "world.key", "must be the key of .*/cell.pem, got 'another key'$"),
    ],
)
def test_what_is_wrong_with_keys_is_said(
    name: str, becomes: str | bytes | int | None, rule: str, keys: Path, made: Path
) -> None:
    """The file is gone, has another mode, another content, or is another's."""
    (keys / "cell.pem").chmod(0o644)  # which is no harm
    files = (str(keys / name) for name in ("ca.pem", "cell.pem", "cell.key"))
    assert read_credentials(keys, "cell/3") == Credentials("cell", *files)
    match becomes:
        case None:
            (keys / name).unlink()
        case int():
            (keys / name).chmod(becomes)
        case bytes():
            (keys / name).write_bytes(becomes)
        case str():
            (keys / name).write_bytes((made / "keys" / becomes).read_bytes())
    with pytest.raises(InvalidValueError, match=rf"/{re.escape(name)}: {rule}"):
        read_credentials(keys, "cell")


def test_time_has_its_bounds(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys, second = made / "keys", timedelta(seconds=1)
    found = certificate(keys, "cell")
    last, first = found.not_valid_after_utc, found.not_valid_before_utc
    for now in (last, first):
        let_be(now, monkeypatch)
        read_credentials(keys, "cell")
    for now in (last + second, first - second):
        let_be(now, monkeypatch)
        rule = rf"/ca\.pem: must be valid now, .*got '{now:%F %T}'$"
        with pytest.raises(InvalidValueError, match=rule):
            read_credentials(keys, "cell")


def test_a_part_of_no_role_is_refused(made: Path) -> None:
    rule = r"^part: must be of hub, .*, got '\.\./secret'$"
    with pytest.raises(InvalidValueError, match=rule):
        read_credentials(made / "keys", "../secret")


# Expiry -------------------------------------------------------------------------------


@pytest.mark.parametrize(("days", "warned"), [(29, True), (31, False)])
def test_what_expires_within_thirty_days_is_warned_of_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, days: int, warned: bool
) -> None:
    folder = tmp_path / "keys"
    made = make_keys(folder, days=days)
    for role in ROLES:
        read_credentials(folder, role)
    said = [record.getMessage() for record in caplog.records]
    text = f"keys in {folder}: expires on {made.until:%F %H:%M} UTC, in 28 days; "
    assert [line.startswith(text) for line in said] == [True] * warned
