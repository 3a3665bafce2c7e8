"""Keys are made whole or not at all, and what is wrong with them is said up front."""

import os
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID

from neurosnap.apps.doctor import check_keys
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.security.make_keys import make_keys, revoke
from neurosnap.fabric.security.roles import ROLES, Role


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    folder = tmp_path / "keys"
    make_keys(folder, ["hub.example", "192.168.0.7"])
    return folder


def certificate(folder: Path, stem: str) -> x509.Certificate:
    return x509.load_pem_x509_certificate((folder / f"{stem}.pem").read_bytes())


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


# Making -------------------------------------------------------------------------------


def test_there_are_two_files_a_role_and_two_of_the_authority(keys: Path) -> None:
    stems = ("ca", *ROLES)
    wanted = {f"{stem}{end}" for stem in stems for end in (".pem", ".key")}
    wanted.add("names.json")
    assert {path.name for path in keys.iterdir()} == wanted
    assert [path.name for path in keys.parent.iterdir()] == ["keys"]


def test_only_the_owner_can_look_whatever_the_umask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        make_keys(tmp_path / "keys")
    finally:
        os.umask(before)
    assert mode(tmp_path / "keys") == 0o700
    assert {mode(path) for path in (tmp_path / "keys").iterdir()} == {0o600}


@pytest.mark.parametrize("stem", ["ca", *ROLES])
def test_each_has_a_key_of_its_own_on_p_256(keys: Path, stem: str) -> None:
    key = load_pem_private_key((keys / f"{stem}.key").read_bytes(), None)
    assert isinstance(key, ec.EllipticCurvePrivateKey)
    assert isinstance(key.curve, ec.SECP256R1)
    assert key.public_key() == certificate(keys, stem).public_key()
    numbers = {
        certificate(keys, each).public_key().public_numbers()  # type: ignore[union-attr]
        for each in ("ca", *ROLES)
    }
    assert len(numbers) == 1 + len(ROLES)


@pytest.mark.parametrize("role", ROLES)
def test_a_certificate_says_its_role_and_what_it_is_for(keys: Path, role: Role) -> None:
    found = certificate(keys, role)
    assert found.subject.rfc4514_string() == f"CN={role}"
    found.verify_directly_issued_by(certificate(keys, "ca"))
    extensions = found.extensions
    assert not extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    usage = extensions.get_extension_for_class(x509.KeyUsage).value
    assert usage.digital_signature
    assert not usage.key_cert_sign
    uses = set(extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)
    assert ExtendedKeyUsageOID.CLIENT_AUTH in uses
    assert (ExtendedKeyUsageOID.SERVER_AUTH in uses) == (role == "hub")


def test_the_hub_is_known_by_its_names(keys: Path) -> None:
    names = (
        certificate(keys, "hub")
        .extensions.get_extension_for_class(x509.SubjectAlternativeName)
        .value
    )
    assert names.get_values_for_type(x509.DNSName) == ["localhost", "hub.example"]
    addresses = names.get_values_for_type(x509.IPAddress)
    assert [str(each) for each in addresses] == ["127.0.0.1", "::1", "192.168.0.7"]


def test_they_are_valid_for_so_many_days(tmp_path: Path) -> None:
    now = datetime(2030, 5, 1, 12, tzinfo=UTC)
    made = make_keys(tmp_path / "keys", days=3, now=now)
    assert made.until == now + timedelta(days=3)
    for stem in ("ca", *ROLES):
        found = certificate(tmp_path / "keys", stem)
        assert found.not_valid_after_utc == made.until
        assert found.not_valid_before_utc == now - timedelta(hours=1)


def test_what_is_there_stays_as_it_is(keys: Path) -> None:
    before = {path: path.read_bytes() for path in keys.iterdir()}
    rule = rf"^keys: must not exist yet, got '{re.escape(str(keys))}'$"
    with pytest.raises(InvalidValueError, match=rule):
        make_keys(keys)
    assert {path: path.read_bytes() for path in keys.iterdir()} == before


def test_not_even_a_link_to_nowhere_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "keys").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InvalidValueError, match=r"^keys: must not exist yet"):
        make_keys(tmp_path / "keys")


def test_a_folder_needs_a_parent(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"^keys: must be in a folder that"):
        make_keys(tmp_path / "a" / "keys")


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


@pytest.mark.parametrize("days", [0, -1, 3651])
def test_days_have_bounds(tmp_path: Path, days: int) -> None:
    rule = rf"^days: must be in \[1, 3650\], got {days}$"
    with pytest.raises(InvalidValueError, match=rule):
        make_keys(tmp_path / "keys", days=days)


@pytest.mark.parametrize(
    "host", ["", "a b", "-a", "*.example", "a/b", "a..b", "hub.example:7447", "x" * 64]
)
def test_a_host_is_a_name_or_an_address(tmp_path: Path, host: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^host: must be a name or an address"):
        make_keys(tmp_path / "keys", [host])
    assert list(tmp_path.iterdir()) == []


# Reading ------------------------------------------------------------------------------


def refused(folder: Path, rule: str, role: str = "cell") -> None:
    with pytest.raises(InvalidValueError, match=rule):
        read_credentials(folder, role)


@pytest.mark.parametrize("role", ROLES)
def test_what_was_made_can_be_read(keys: Path, role: Role) -> None:
    found = read_credentials(keys, role)
    accepted: dict[str, str] = {}
    if role == "hub":
        accepted = {name: name for name in ROLES}
    assert found == Credentials(
        role, f"{keys}/ca.pem", f"{keys}/{role}.pem", f"{keys}/{role}.key", accepted
    )


def test_a_part_needs_its_own_files_and_the_authoritys_certificate_alone(
    keys: Path,
) -> None:
    for path in keys.iterdir():
        if path.name not in ("ca.pem", "cell.pem", "cell.key"):
            path.unlink()
    assert read_credentials(keys, "cell").name == "cell"
    refused(
        keys,
        r"/hub\.pem: must be a file that can be read, got 'No such",
        "hub",
    )


@pytest.mark.parametrize("name", ["ca.pem", "cell.pem", "cell.key"])
def test_a_missing_file_is_named(keys: Path, name: str) -> None:
    (keys / name).unlink()
    refused(keys, rf"/{re.escape(name)}: must be a file that can be read, got 'No such")


@pytest.mark.parametrize("bits", [0o640, 0o604, 0o620, 0o601])
def test_a_key_others_can_get_at_is_refused(keys: Path, bits: int) -> None:
    (keys / "cell.key").chmod(bits)
    refused(keys, rf"/cell\.key: must be readable by its owner only.*got '{bits:04o}'$")


@pytest.mark.parametrize("name", ["ca.pem", "cell.pem"])
def test_a_certificate_others_can_write_is_refused(keys: Path, name: str) -> None:
    (keys / name).chmod(0o644)
    assert read_credentials(keys, "cell").name == "cell"
    (keys / name).chmod(0o664)
    refused(keys, rf"/{re.escape(name)}: must be writable by its owner only")


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("ca.pem", "must be a certificate in PEM"),
        ("cell.pem", "must be a certificate in PEM"),
        ("cell.key", "must be a private key in PEM, without a password, got 'someth"),
    ],
)
def test_what_is_no_pem_is_refused(keys: Path, name: str, rule: str) -> None:
    (keys / name).write_bytes(b"-----BEGIN NONSENSE-----\n")
    refused(keys, rf"/{re.escape(name)}: {rule}")


def test_time_has_its_bounds(keys: Path) -> None:
    made = certificate(keys, "cell")
    last, second = made.not_valid_after_utc, timedelta(seconds=1)
    read_credentials(keys, "cell", now=last)
    read_credentials(keys, "cell", now=made.not_valid_before_utc)
    for now in (last + second, made.not_valid_before_utc - second):
        rule = rf"/ca\.pem: must be valid now, .*got '{now:%F %T}'$"
        with pytest.raises(InvalidValueError, match=rule):
            read_credentials(keys, "cell", now=now)


def test_expired_keys_are_refused_today(tmp_path: Path) -> None:
    make_keys(tmp_path / "old", days=1, now=datetime(2020, 1, 1, tzinfo=UTC))
    refused(
        tmp_path / "old", r"must be valid now, it is from 2019-12-31 23:00:00 to 20"
    )


def test_another_authoritys_certificate_is_refused(keys: Path, tmp_path: Path) -> None:
    make_keys(tmp_path / "other")
    for name in ("cell.pem", "cell.key"):
        (keys / name).write_bytes((tmp_path / "other" / name).read_bytes())
    refused(keys, r"/cell\.pem: must be signed by .*/ca\.pem, got ")


def test_another_roles_certificate_is_refused(keys: Path) -> None:
    for end in ("pem", "key"):
        (keys / f"cell.{end}").write_bytes((keys / f"world.{end}").read_bytes())
    refused(keys, r"/cell\.pem: must be for cell, got 'world'$")


def test_another_certificates_key_is_refused(keys: Path) -> None:
    (keys / "cell.key").write_bytes((keys / "world.key").read_bytes())
    refused(keys, r"/cell\.key: must be the key of .*/cell\.pem, got 'another key'$")


def test_a_role_nobody_has_is_refused(keys: Path) -> None:
    rule = r"^part: must be of hub, .*, got '\.\./secret'$"
    with pytest.raises(InvalidValueError, match=rule):
        read_credentials(keys, "../secret")


@pytest.mark.parametrize("who", ["cell/../hub", "cell//3", "cell/*", "cell/3#1"])
def test_a_part_nobody_can_be_is_refused(keys: Path, who: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^part: must be like cell/3, got"):
        read_credentials(keys, who)


# Parts --------------------------------------------------------------------------------

PARTS = ("cell/0", "cell/1", "worker/0")


@pytest.fixture
def parted(tmp_path: Path) -> Path:
    folder = tmp_path / "parted"
    make_keys(folder, parts=PARTS)
    return folder


def test_a_part_has_files_of_its_own_and_its_role_has_none(parted: Path) -> None:
    assert {path.name for path in parted.glob("*/*")} == {
        "0.pem",
        "0.key",
        "1.pem",
        "1.key",
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


def test_a_host_needs_the_files_of_its_own_parts_alone(
    parted: Path, tmp_path: Path
) -> None:
    there = tmp_path / "there"
    (there / "cell").mkdir(parents=True, mode=0o700)
    for name in ("ca.pem", "cell/1.pem", "cell/1.key"):
        (there / name).write_bytes((parted / name).read_bytes())
        (there / name).chmod(0o600)
    assert read_credentials(there, "cell/1").name == "cell/1"
    refused(there, r"/cell\.pem: must be a file that can be read", "cell/0")


def test_a_part_cannot_pass_for_another_by_the_name_of_a_file(parted: Path) -> None:
    for end in (".pem", ".key"):
        (parted / f"cell/1{end}").replace(parted / f"cell/0{end}")
    with pytest.raises(InvalidValueError, match=r"must be for cell/0, got 'cell/1'$"):
        read_credentials(parted, "cell/0")


@pytest.mark.parametrize(
    "part", ["hub", "cell", "cell/", "cell/x", "cell/03", "world/1", "cell/1/2", "../x"]
)
def test_only_cells_and_workers_are_parts_of_a_number(
    tmp_path: Path, part: str
) -> None:
    with pytest.raises(InvalidValueError, match=r"^parts: must be a cell or a worker"):
        make_keys(tmp_path / "keys", parts=["cell/0", part])
    assert list(tmp_path.iterdir()) == []


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


def test_keys_from_before_there_were_lists_go_on_and_can_be_revoked(keys: Path) -> None:
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


def test_a_list_that_others_may_write_is_refused(parted: Path) -> None:
    (parted / "names.json").chmod(0o620)
    with pytest.raises(InvalidValueError, match=r"/names\.json: must be writable by"):
        read_credentials(parted, "hub")


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
