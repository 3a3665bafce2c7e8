"""Keys are made whole or not at all, and what is wrong with them is said up front."""

import os
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID

from neurosnap.apps.doctor import check_keys
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.security.hub_address import Credentials
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.security.make_keys import make_keys, revoke
from neurosnap.fabric.security.roles import ROLES

PARTS = ("cell/0", "cell/1", "worker/0")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of all roles, another authority's, and keys of parts: only to be read."""
    folder = tmp_path_factory.mktemp("made")
    make_keys(folder / "keys", ["hub.example", "192.168.0.7"])
    make_keys(folder / "other")
    make_keys(folder / "parted", parts=PARTS)
    return folder


@pytest.fixture
def keys(made: Path, tmp_path: Path) -> Path:
    return copytree(made / "keys", tmp_path / "keys")


@pytest.fixture
def parted(made: Path, tmp_path: Path) -> Path:
    return copytree(made / "parted", tmp_path / "parted")


def certificate(folder: Path, stem: str) -> x509.Certificate:
    return x509.load_pem_x509_certificate((folder / f"{stem}.pem").read_bytes())


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


# Making -------------------------------------------------------------------------------


def test_each_role_has_a_certificate_that_says_what_it_is_for(made: Path) -> None:
    folder = made / "keys"
    stems, authority = ("ca", *ROLES), certificate(folder, "ca")
    wanted = {f"{stem}{end}" for stem in stems for end in (".pem", ".key")}
    assert {path.name for path in folder.iterdir()} == wanted | {"names.json"}
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
    tmp_path: Path,
) -> None:
    now, before = datetime(2030, 5, 1, 12, tzinfo=UTC), os.umask(0)
    try:
        made = make_keys(tmp_path / "keys", days=3, now=now)
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
        *[
            ({"parts": ["cell/0", part]}, r"^parts: must be a cell or a worker")
            for part in (
                "hub",
                "cell",
                "cell/",
                "cell/x",
                "cell/03",
                "cell/1/2",
                "../x",
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


def test_what_was_made_can_be_read(made: Path) -> None:
    folder = made / "keys"
    for role in ROLES:
        accepted: dict[str, str] = {each: each for each in ROLES}
        if role != "hub":
            accepted = {}
        ca, pem, key = (
            f"{folder}/{name}" for name in ("ca.pem", f"{role}.pem", f"{role}.key")
        )
        assert read_credentials(folder, role) == Credentials(
            role, ca, pem, key, accepted
        )


def test_a_part_needs_its_own_files_and_the_authoritys_certificate_alone(
    keys: Path, parted: Path
) -> None:
    for folder, who in ((keys, "cell"), (parted, "cell/1")):
        needed = [folder / "ca.pem", folder / f"{who}.pem", folder / f"{who}.key"]
        for path in folder.rglob("*.*"):
            if path not in needed:
                path.unlink()
        assert read_credentials(folder, who).name == who


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
        *[(name, 0o664, OTHERS) for name in ("ca.pem", "cell.pem", "names.json")],
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
    assert read_credentials(keys, "cell").name == "cell"
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


def test_time_has_its_bounds(made: Path) -> None:
    keys, second = made / "keys", timedelta(seconds=1)
    found = certificate(keys, "cell")
    last, first = found.not_valid_after_utc, found.not_valid_before_utc
    read_credentials(keys, "cell", now=last)
    read_credentials(keys, "cell", now=first)
    for now in (last + second, first - second):
        rule = rf"/ca\.pem: must be valid now, .*got '{now:%F %T}'$"
        with pytest.raises(InvalidValueError, match=rule):
            read_credentials(keys, "cell", now=now)


@pytest.mark.parametrize(
    ("who", "rule"),
    [
        ("../secret", r"^part: must be of hub, .*, got '\.\./secret'$"),
        *[
            (who, r"^part: must be like cell/3, got")
            for who in ("cell/../hub", "cell//3", "cell/*", "cell/3#1")
        ],
    ],
)
def test_a_part_nobody_can_be_is_refused(made: Path, who: str, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=rule):
        read_credentials(made / "keys", who)


# Parts --------------------------------------------------------------------------------


def test_a_part_has_files_of_its_own_and_its_role_has_none(parted: Path) -> None:
    assert {path.name for path in parted.glob("cell/*")} == {
        *("0.pem", "0.key", "1.pem", "1.key")
    }
    assert not (parted / "cell.pem").exists()
    assert not (parted / "worker.key").exists()
    assert mode(parted / "cell") == 0o700
    for who in PARTS:
        found = read_credentials(parted, who)
        assert (found.name, found.certificate) == (who, f"{parted}/{who}.pem")
    accepted = read_credentials(parted, "hub").accepted
    assert {*PARTS} <= accepted.keys()
    assert not {"cell", "worker"} & accepted.keys()
    for end in (".pem", ".key"):  # the name of a file proves nothing
        (parted / f"cell/1{end}").replace(parted / f"cell/0{end}")
    with pytest.raises(InvalidValueError, match=r"must be for cell/0, got 'cell/1'$"):
        read_credentials(parted, "cell/0")


# Revoking -----------------------------------------------------------------------------


@pytest.mark.parametrize("who", ["cell/1", "world"])
def test_who_is_revoked_has_other_files_and_the_old_ones_are_refused(
    parted: Path, who: str
) -> None:
    old = {end: (parted / f"{who}{end}").read_bytes() for end in (".pem", ".key")}
    until = revoke(parted, who)
    assert until == certificate(parted, "ca").not_valid_after_utc
    assert read_credentials(parted, who).name == who
    accepted = read_credentials(parted, "hub").accepted
    assert f"{who}#1" in accepted
    assert who not in accepted
    assert mode(parted / f"{who}.key") == 0o600
    for end, content in old.items():
        assert (parted / f"{who}{end}").read_bytes() != content
        (parted / f"{who}{end}").write_bytes(content)
    with pytest.raises(InvalidValueError, match="must not have been revoked"):
        read_credentials(parted, who)
    revoke(parted, who)
    assert f"{who}#2" in read_credentials(parted, "hub").accepted


def test_a_folder_without_a_list_of_names_has_one_once_a_role_is_revoked(
    keys: Path,
) -> None:
    (keys / "names.json").unlink()
    for role in ROLES:
        assert read_credentials(keys, role).name == role
    revoke(keys, "cell")
    accepted = read_credentials(keys, "hub").accepted
    assert sorted(accepted.values()) == sorted(ROLES)
    assert accepted["cell#1"] == "cell"


@pytest.mark.parametrize("who", ["hub", "cell", "cell/9", "ca", ""])
def test_who_has_no_certificate_cannot_be_revoked_nor_can_the_hub(
    parted: Path, who: str
) -> None:
    before = (parted / "names.json").read_bytes()
    with pytest.raises(InvalidValueError, match=r"^revoke: must be a part or a role"):
        revoke(parted, who)
    assert (parted / "names.json").read_bytes() == before


def test_revoking_takes_the_authoritys_key(parted: Path) -> None:
    (parted / "ca.key").unlink()
    with pytest.raises(
        InvalidValueError, match=r"/ca\.key: must be a file that can be"
    ):
        revoke(parted, "cell/0")


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


def test_the_doctor_looks_at_keys(tmp_path: Path) -> None:
    make_keys(tmp_path / "long")
    make_keys(tmp_path / "soon", days=3)
    make_keys(tmp_path / "old", days=1, now=datetime.now(UTC) - timedelta(days=9))
    found = {
        name: check_keys(tmp_path / name)[0] for name in ("long", "soon", "old", "x")
    }
    assert [each.ok for each in found.values()] == [True, True, False, False]
    assert [bool(each.fix) for each in found.values()] == [False, True, True, True]
