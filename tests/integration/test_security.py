"""Under mutual TLS strangers are refused, and so are hubs of another authority.

The hub is a process of its own, as in a run: which sessions it refuses is in the log of
Zenoh there.
"""

import asyncio
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import pytest
import zenoh
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

from neurosnap.errors import FabricError
from neurosnap.fabric.certificates import make_keys
from neurosnap.fabric.hub_address import Credentials
from neurosnap.fabric.roles import Role
from neurosnap.fabric.zenoh.connect_session import configuration
from tests.support.fabrics import Seen
from tests.support.secured_hub import INTRUSION, Hub, hub_with

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


# Certificates -------------------------------------------------------------------------


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
    folder.mkdir()
    path = folder / f"{role}.pem"
    path.write_bytes(builder.sign(signer, SHA256()).public_bytes(Encoding.PEM))
    own = Credentials.in_folder(keys, role)
    return msgspec.structs.replace(own, certificate=str(path))


async def refuses(hub: Hub, credentials: Credentials) -> None:
    with pytest.raises(FabricError, match=r"^cell/0: must reach the hub at tls/"):
        async with hub.end_with("cell/0", credentials, INTRUSION):
            pass


async def test_who_has_no_good_certificate_is_refused(
    role_keys: Path, tmp_path: Path
) -> None:
    """None at all, no TLS, another authority's, an expired one, one that expires."""
    now, day, seen = datetime.now(UTC), timedelta(days=1), Seen()
    old = issue(role_keys, tmp_path / "old", "cell", now - 3 * day, now - day)
    make_keys(tmp_path / "other")
    other = msgspec.structs.replace(
        Credentials.in_folder(tmp_path / "other", "cell"),
        authority=str(role_keys / "ca.pem"),
    )
    with hub_with(role_keys) as hub:
        end = datetime.now(UTC) + timedelta(seconds=5)
        soon = issue(role_keys, tmp_path / "soon", "cell", now - day, end)
        async with hub.end("watcher") as eyes, hub.end_with("cell/0", soon) as cell:
            await eyes.watch(seen)
            await cell.announce()
            await seen.wait(("cell/0", True))
            tls = {"root_ca_certificate": str(role_keys / "ca.pem")}
            for endpoint, more in (
                (hub.endpoint, {"transport__link__tls": tls}),
                (hub.endpoint.replace("tls/", "tcp/"), {}),
            ):
                config = configuration(
                    "client",
                    connect__endpoints=[endpoint],
                    connect__timeout_ms=int(1000 * INTRUSION),
                    **more,
                )
                with pytest.raises(zenoh.ZError):
                    await asyncio.to_thread(zenoh.open, config)
            await refuses(hub, other)
            await refuses(hub, old)
            await seen.wait(("cell/0", False))
    assert len(hub.refused) >= 5  # who does not speak TLS is refused in other words
    for reason in (
        r"peer sent no certificates\.",
        r"invalid peer certificate: certificate expired",
        r"invalid peer certificate: (?!certificate expired)",
        r"Closing TLS link .*remote certificate chain expired",
    ):
        assert any(re.search(reason, line) for line in hub.refused)


async def test_a_part_believes_no_hub_of_another_authority(
    role_keys: Path, tmp_path: Path
) -> None:
    make_keys(tmp_path / "other")
    with hub_with(tmp_path / "other") as hub:
        await refuses(hub, Credentials.in_folder(role_keys, "cell"))
