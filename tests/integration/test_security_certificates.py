"""Who has no good certificate is refused by a hub, and that shows."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import pytest
import zenoh
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.security.make_keys import make_keys
from neurosnap.fabric.security.roles import Role
from neurosnap.fabric.zenoh.session import configuration
from tests.support.fabrics import Seen
from tests.support.secured_hub import INTRUSION, Hub, hub_with

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("security") / "keys"
    make_keys(folder)
    return folder


def issue(
    keys: Path, folder: Path, role: Role, since: datetime, until: datetime
) -> Credentials:
    """Sign another certificate with the authority's own key."""
    authority = x509.load_pem_x509_certificate((keys / "ca.pem").read_bytes())
    signer = load_pem_private_key((keys / "ca.key").read_bytes(), None)
    assert isinstance(signer, ec.EllipticCurvePrivateKey)
    good = x509.load_pem_x509_certificate((keys / f"{role}.pem").read_bytes())
    builder = (
        x509.CertificateBuilder()
        .subject_name(good.subject)
        .issuer_name(authority.subject)
        .public_key(good.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(since)
        .not_valid_after(until)
    )
    for extension in good.extensions:
        builder = builder.add_extension(extension.value, extension.critical)
    path = folder / f"{role}.pem"
    path.write_bytes(builder.sign(signer, SHA256()).public_bytes(Encoding.PEM))
    own = Credentials.in_folder(keys, role)
    return msgspec.structs.replace(own, certificate=str(path))


async def refuses(hub: Hub, credentials: Credentials) -> None:
    with pytest.raises(FabricError, match=r"^cell/0: must reach the hub at tls/"):
        async with hub.end_with("cell/0", credentials):
            pass


def test_who_has_no_certificate_is_refused_and_logged(keys: Path) -> None:
    with hub_with(keys) as hub:
        config = configuration(
            "client",
            connect__endpoints=[hub.endpoint],
            connect__timeout_ms=int(1000 * INTRUSION),
            transport__link__tls={"root_ca_certificate": str(keys / "ca.pem")},
        )
        with pytest.raises(zenoh.ZError):
            zenoh.open(config)
    assert hub.refused[0] == "session refused: peer sent no certificates."


def test_who_does_not_speak_tls_is_refused_and_logged(keys: Path) -> None:
    with hub_with(keys) as hub:
        config = configuration(
            "client",
            connect__endpoints=[hub.endpoint.replace("tls/", "tcp/")],
            connect__timeout_ms=int(1000 * INTRUSION),
        )
        with pytest.raises(zenoh.ZError):
            zenoh.open(config)
    assert hub.refused[0].startswith("session refused: ")


async def test_a_certificate_of_another_authority_is_refused_and_logged(
    keys: Path, tmp_path: Path
) -> None:
    make_keys(tmp_path / "other")
    other = Credentials.in_folder(tmp_path / "other", "cell")
    believing = msgspec.structs.replace(other, authority=str(keys / "ca.pem"))
    with hub_with(keys) as hub:
        await refuses(hub, believing)
    assert hub.refused[0].startswith("session refused: invalid peer certificate: ")


async def test_an_expired_certificate_is_refused_and_logged(
    keys: Path, tmp_path: Path
) -> None:
    now = datetime.now(UTC)
    old = issue(
        keys, tmp_path, "cell", now - timedelta(days=3), now - timedelta(days=1)
    )
    with hub_with(keys) as hub:
        await refuses(hub, old)
    reason = "session refused: invalid peer certificate: certificate expired"
    assert hub.refused[0].startswith(reason)


def test_an_expired_certificate_is_noticed_before_it_is_shown(
    keys: Path, tmp_path: Path
) -> None:
    now = datetime.now(UTC)
    issue(keys, tmp_path, "cell", now - timedelta(days=3), now - timedelta(days=1))
    for name in ("ca.pem", "cell.key"):
        (tmp_path / name).write_bytes((keys / name).read_bytes())
    (tmp_path / "cell.key").chmod(0o600)
    with pytest.raises(InvalidValueError, match=r"/cell\.pem: must be valid now, "):
        read_credentials(tmp_path, "cell")


async def test_a_part_believes_no_hub_of_another_authority(
    keys: Path, tmp_path: Path
) -> None:
    make_keys(tmp_path / "other")
    with hub_with(tmp_path / "other") as hub:
        await refuses(hub, Credentials.in_folder(keys, "cell"))


async def test_a_link_ends_with_its_certificate(keys: Path, tmp_path: Path) -> None:
    now, seen = datetime.now(UTC), Seen()
    soon = issue(
        keys, tmp_path, "cell", now - timedelta(days=1), now + timedelta(seconds=3)
    )
    with hub_with(keys) as hub:
        async with hub.end("watcher") as eyes, hub.end_with("cell/0", soon) as cell:
            await eyes.watch(seen)
            await cell.announce()
            await seen.wait(("cell/0", True))
            await seen.wait(("cell/0", False))
    assert hub.refused[0].startswith("session refused: Closing TLS link ")
    assert hub.refused[0].endswith("remote certificate chain expired")
