"""Sources that look for a broker: one that refuses, is not trusted, or is not there."""

import asyncio
import logging
import socket
import subprocess
import threading
from contextlib import closing
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Self

import aiomqtt
import msgspec
import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
)
from cryptography.x509.oid import NameOID

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.mqtt.mqtt_source import mqtt_source
from neurosnap.sources.mqtt.options import MqttBroker, MqttPublish, MqttSensor
from neurosnap.sources.mqtt.publisher import MqttPublisher
from tests.support.mosquitto import HOST, Mosquitto, needs_mosquitto, started
from tests.support.mqtt_sources import PREFIX, options, source_of, until

pytestmark = [
    pytest.mark.slow,
    needs_mosquitto,
]

SECRET = "correct-horse"


@pytest.mark.parametrize("given", ["wrong-staple", ""])
async def test_a_refused_password_ends_the_start_and_is_not_shown(
    tmp_path: Path, given: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    passwords = tmp_path / "passwords"
    subprocess.run(  # noqa: ASYNC221 - nothing else goes on yet
        ["mosquitto_passwd", "-b", "-c", str(passwords), "neuro", SECRET], check=True
    )
    place = tmp_path / "secret"
    place.write_text(f"{given}\n")
    lines = ("allow_anonymous false", f"password_file {passwords}")
    with started(tmp_path, *lines) as broker:
        right = tmp_path / "right"
        right.write_text(f"{SECRET}\n")
        named = msgspec.structs.replace(
            broker.options, username="neuro", password_file=str(right)
        )
        table = options(named)
        with source_of(table) as source:
            table = options(msgspec.structs.replace(named, password_file=str(place)))
            if given:
                with (
                    source_of(table) as other,
                    pytest.raises(
                        InvalidValueError,
                        match=rf"^username: must be taken by {HOST}:{broker.port}, "
                        r"with its password \(.*[Nn]ot authori[sz]ed\), got 'neuro'$",
                    ),
                ):
                    await asyncio.to_thread(other.first)
            else:
                with pytest.raises(InvalidValueError, match=r"^password_file: must"):
                    mqtt_source(table)
            with ThreadedFirst(source) as waiting:
                async with aiomqtt.Client(
                    HOST, broker.port, username="neuro", password=SECRET
                ) as client:
                    await client.publish("house/door", "ON", qos=1, retain=True)
                    assert await asyncio.to_thread(waiting.result) == [True]
    text = caplog.text + repr(table) + msgspec.json.encode(table).decode()
    assert SECRET not in text
    assert "wrong-staple" not in text


class ThreadedFirst:
    """A source's first tick, waited for in a thread."""

    def __init__(self, source: LiveSource) -> None:
        self._source = source
        self._bits: list[bool] = []
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        seen = self._source.first()
        self._bits = [] if seen is None else seen.bits.tolist()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def result(self) -> list[bool]:
        self._thread.join()
        return self._bits

    def __exit__(self, *_: object) -> None:
        self._source.close()
        self._thread.join()


def certificates(folder: Path) -> tuple[Path, Path, Path]:
    """Make an authority, and a broker's key and certificate signed by it."""
    keys = [ec.generate_private_key(ec.SECP256R1()) for _ in range(2)]
    names = [
        x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        for name in ("authority", "broker")
    ]
    now = datetime.now(UTC)
    files = [folder / name for name in ("ca.pem", "broker.pem", "broker.key")]
    for k in range(2):
        building = (
            x509.CertificateBuilder()
            .subject_name(names[k])
            .issuer_name(names[0])
            .public_key(keys[k].public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(hours=1))
            .not_valid_after(now + timedelta(hours=1))
            .add_extension(x509.BasicConstraints(ca=k == 0, path_length=None), True)
        )
        if k == 1:
            address = x509.IPAddress(ip_address(HOST))
            building = building.add_extension(
                x509.SubjectAlternativeName([address]), critical=False
            )
        signed = building.sign(keys[0], SHA256())
        files[k].write_bytes(signed.public_bytes(Encoding.PEM))
    files[2].write_bytes(
        keys[1].private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    )
    return files[0], files[1], files[2]


# The library does not close the socket of a failed handshake, and Python says so.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
async def test_with_tls_only_a_broker_that_is_trusted_is_spoken_to(
    tmp_path: Path,
) -> None:
    authority, certificate, key = certificates(tmp_path)
    lines = ("allow_anonymous true", f"certfile {certificate}", f"keyfile {key}")
    with started(tmp_path, *lines) as broker:
        trusting = msgspec.structs.replace(
            broker.options, tls=True, ca_file=str(authority)
        )
        sensor = MqttSensor(name="up", topic=f"{PREFIX}/world/status")
        with source_of(options(trusting, sensor)) as source:
            await until(source, lambda r: r["up"] is True)
        blind = msgspec.structs.replace(broker.options, tls=True)
        with (
            source_of(options(blind)) as source,
            pytest.raises(
                InvalidValueError,
                match=r"^broker: must have a certificate that is trusted \(.*verify fa",
            ),
        ):
            await asyncio.to_thread(source.first)
    nothing = msgspec.structs.replace(trusting, ca_file=str(tmp_path / "none.pem"))
    with pytest.raises(
        InvalidValueError, match=r"^ca_file: must be PEM .*No such file"
    ):
        mqtt_source(options(nothing))


@pytest.mark.parametrize("host", [HOST, "no-such-host.invalid"])
async def test_a_broker_that_is_not_there_ends_the_start_when_the_patience_is_over(
    tmp_path: Path, host: str
) -> None:
    port = Mosquitto(tmp_path).port
    gone = MqttBroker(host=host, port=port, patience=0.1)
    with (
        source_of(options(gone)) as source,
        pytest.raises(
            NeurosnapError,
            match=rf"^broker: must answer within 0.1 s, got nothing from {host}:{port} ",
        ),
    ):
        await asyncio.to_thread(source.first)


async def test_a_broker_that_says_nothing_ends_the_start_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.sources.mqtt.connection._ANSWER", 0.2)
    with closing(socket.create_server((HOST, 0))) as mute:
        port = mute.getsockname()[1]
        broker = MqttBroker(host=HOST, port=port, patience=0.1)
        with (
            source_of(options(broker)) as source,
            pytest.raises(NeurosnapError, match=r"\(Operation timed out\)$"),
        ):
            await asyncio.to_thread(source.first)


async def test_who_is_stopped_while_connecting_does_not_fail_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.sources.mqtt.connection._ANSWER", 0.2)
    stop = asyncio.Event()
    with closing(socket.create_server((HOST, 0))) as mute:
        broker = MqttBroker(host=HOST, port=mute.getsockname()[1], patience=0.1)
        outlet = MqttPublisher(broker, MqttPublish(), ["door"])
        serving = asyncio.create_task(outlet.serve(stop))
        connection, _ = await asyncio.to_thread(mute.accept)
        stop.set()
        await serving
        connection.close()


async def test_a_source_can_be_closed_while_it_looks_for_its_broker(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    failed = threading.Event()

    class Watch(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            failed.set()

    gone = MqttBroker(host=HOST, port=Mosquitto(tmp_path).port, patience=3600)
    logger = logging.getLogger("neurosnap.sources.mqtt.connection")
    watch = Watch()
    logger.addHandler(watch)
    try:
        source = mqtt_source(options(gone))
        waiting = asyncio.create_task(asyncio.to_thread(source.first))
        await asyncio.to_thread(failed.wait)
        await asyncio.to_thread(source.close)
        assert await waiting is None
    finally:
        logger.removeHandler(watch)
