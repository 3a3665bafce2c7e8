"""``--broker``: overrides the MQTT broker of a file, or starts an embedded one."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from neurosnap.apps.cli.output import warn
from neurosnap.errors import InvalidValueError
from neurosnap.system.distribution import must_have

EMBEDDED = "embedded"


@contextmanager
def brokered(broker: str, source: str) -> Iterator[dict[str, object]]:
    """Return what goes before a file that describes an MQTT source.

    Args:
        broker: ``embedded``: one is started and ends with the context. Or where one is,
            as HOST or HOST:PORT. Empty: as the file has it. What the file says of its
            own broker, name, password and TLS among it, is not for another: one that
            needs any of it is described in a file.
        source: The file.

    Raises:
        InvalidValueError: It is neither, there is no broker to embed, or `source` is
            no file that describes an MQTT source.
    """
    if broker and not _is_mqtt(source):
        rule = 'must go with a TOML file that says kind = "mqtt" under [source]'
        raise InvalidValueError("broker", rule, broker)
    if broker != EMBEDDED:
        yield _elsewhere(broker) if broker else {}
        return
    try:
        from neurosnap.sources.mqtt.embedded_broker import HOST, EmbeddedBroker
    except ImportError as error:  # an extra
        rule = must_have(error.name or "amqtt", "mqtt")
        raise InvalidValueError("broker", rule, broker) from error
    with EmbeddedBroker() as here:
        warn(f"a broker listens on {HOST}:{here.port}")
        yield {"source.broker": {"host": HOST, "port": here.port}}


def _is_mqtt(source: str) -> bool:
    from neurosnap.apps.config.load import source_kind

    return source.lower().endswith(".toml") and source_kind(Path(source)) == "mqtt"


def _elsewhere(broker: str) -> dict[str, object]:
    return {"source.broker": host_and_port(broker, f"{EMBEDDED}, HOST or HOST:PORT")}


def host_and_port(broker: str, forms: str) -> dict[str, object]:
    """Return `broker` as a table of a file has it.

    Args:
        broker: HOST or HOST:PORT.
        forms: What it may be, for the error.

    Raises:
        InvalidValueError: It is nothing of it.
    """
    host, colon, port = broker.rpartition(":") if ":" in broker else (broker, "", "")
    if not host or ":" in host or (colon and not port.isdecimal()):
        raise InvalidValueError("broker", f"must be {forms}", broker)
    return {"host": host} | ({"port": int(port)} if colon else {})
