"""``neurosnap init`` and ``check``: make and check the files that describe a swarm."""

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    Force,
    Format,
    convert,
    errors,
    run_async,
)
from neurosnap.apps.cli.run_flags import FLAG, with_parameters
from neurosnap.apps.cli.terminal_output import print_facts, say, table, warn
from neurosnap.apps.new_files import free_path
from neurosnap.errors import InvalidValueError, MissingExtraError, NeurosnapError
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.sensorium import visible
from neurosnap.sources.mqtt.options import MqttBroker, MqttSensor
from neurosnap.system.distribution import must_have

if TYPE_CHECKING:
    from neurosnap.sources.mqtt.topic_survey import HeardTopic, Survey

_SHOWN = 3  # values of a topic in a line
_EXAMPLE = "Example: neurosnap init topics homeassistant.local --out home.toml"

TomlFile = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FILE",
        help="Write a TOML file that makes sensors of what looks like them.",
        show_default="only list the topics",
    ),
]

init = typer.Typer(
    help="Write what a swarm begins with: a TOML file from a broker's topics, or keys.",
    no_args_is_help=True,
)
app.add_typer(init, name="init")


@init.command(epilog=_EXAMPLE)
@with_parameters(
    topic=(
        str,
        typer.Option(
            "#", metavar="FILTER", help="Listen to these topics only (home/#)."
        ),
    ),
    username=(str | None, typer.Option(None, help="The user name for the broker.")),
    password_file=(
        Path | None,
        typer.Option(
            None,
            metavar="FILE",
            help="A file whose first line is its password.",
        ),
    ),
    encrypt=(
        bool,
        typer.Option(False, "--encrypt", metavar=FLAG, help="Encrypt the connection."),
    ),
    ca_file=(
        Path | None,
        typer.Option(None, metavar="FILE", help="Trust these certificates (PEM) only."),
    ),
)
def topics(
    context: typer.Context,
    host: Annotated[
        str, typer.Argument(metavar="HOST[:PORT]", help="Where the broker is.")
    ],
    seconds: Annotated[
        float,
        typer.Option(
            min=0.1, max=86_400, help="How long to listen; Ctrl-C ends it earlier."
        ),
    ] = 60.0,
    out: TomlFile = None,
    force: Force = False,
    form: Format = "text",
) -> None:
    """Listen to an MQTT broker, list its topics, and write a file to begin with."""
    with errors():
        topic, broker = context.params["topic"], _broker(host, context.params)
        check_free(out, force=force)
        survey = _listened(broker, topic, seconds)
        say(form, *_lines(survey))
        if out is not None:
            _write(out, broker, survey, force=force)
            count = len(survey.sensors())
            say(form, f"wrote {out} with {count} sensors; read it, then:")
            say(form, f"neurosnap run {out}")
        print_facts(form, {**_facts(survey), "out": out and str(out)})


def check_free(out: Path | None, *, force: bool) -> None:
    """Check where a file that describes a run is to be written, if anywhere.

    Raises:
        InvalidValueError: Its name does not say so, or something is there already.
    """
    if out is not None:
        if out.suffix.lower() != ".toml":
            raise InvalidValueError("out", "must end with .toml", str(out))
        free_path(out, force=force)


def _broker(host: str, given: dict[str, Any]) -> MqttBroker:
    """Return the broker that was given."""
    # A file that is run looks for its own files from its own folder.
    files = {name: given[name] for name in ("password_file", "ca_file")}
    found = {k: str(v.absolute()) for k, v in files.items() if v is not None}
    login = {"username": given["username"], "tls": given["encrypt"]}
    name, colon, port = host.rpartition(":") if ":" in host else (host, "", "")
    if not name or ":" in name or (colon and not port.isdecimal()):
        raise InvalidValueError("broker", "must be HOST or HOST:PORT", host)
    where = {"host": name} | ({"port": int(port)} if colon else {})
    return convert(MqttBroker, **where, **login, **found)


def _write(out: Path, broker: MqttBroker, survey: "Survey", *, force: bool) -> None:
    """Write a file that runs on the topics that look like sensors."""
    if not (sensors := survey.sensors()):
        rule = "must have a topic that looks like a sensor"
        raise NeurosnapError(f"broker: {rule}, got none in what came")
    by_topic = {heard.topic: heard for heard in survey.topics()}
    said = {each.name: _said(by_topic[each.topic], each) for each in sensors}
    text = mqtt_file(broker, sensors, said)
    with out.open("w" if force else "x", encoding="utf-8") as file:
        file.write(text)


def _facts(survey: "Survey") -> dict[str, object]:
    return {
        "topics": [
            {"topic": h.topic, "messages": h.messages, "kind": h.kind}
            for h in survey.topics()
        ],
        "sensors": [
            {"name": s.name, "topic": s.topic, "field": s.field}
            for s in survey.sensors()
        ],
        "passed_over": survey.passed_over,
    }


def _listened(broker: MqttBroker, topic: str, seconds: float) -> "Survey":
    """Return what came at `broker` in so many seconds, or until Ctrl-C."""
    try:
        import aiomqtt

        from neurosnap.sources.mqtt.connection import MqttLink
    except ImportError as error:  # an extra
        rule = must_have(error.name or "aiomqtt", "mqtt")
        raise MissingExtraError(f"topics: {rule}") from error
    try:
        aiomqtt.Wildcard(topic)
    except ValueError as error:
        rule = "must be a topic filter, + or # alone in a level and # in the last"
        raise InvalidValueError("topic", rule, topic) from error
    from neurosnap.sources.mqtt.topic_survey import Survey

    survey = Survey()

    def receive(name: str, data: bytes, _retained: bool) -> None:
        if survey.add(name, data):
            warn(f"heard {visible(name)}")

    async def work(stop: asyncio.Event) -> None:
        there = asyncio.Event()

        def connected(on: bool) -> None:
            if on and not there.is_set():
                there.set()
                warn(f"listening at {broker.address} for {seconds:g} s (or Ctrl-C)")

        link = MqttLink(
            broker, "topics", filters=[topic], receive=receive, connected=connected
        )
        over = asyncio.Event()
        serving = asyncio.create_task(link.serve(over), name="topics/serve")
        serving.add_done_callback(lambda _: stop.set())
        await wait_any(there, stop)
        await wait_any(stop, seconds=seconds)
        over.set()
        await serving

    run_async(work)
    return survey


def _lines(survey: "Survey") -> Iterator[str]:
    """List the topics, and the sensors made of each."""
    names: dict[str, list[str]] = {}
    for sensor in survey.sensors():
        names.setdefault(sensor.topic, []).append(sensor.name)
    rows = [("topic", "messages", "payloads", "sensors")]
    for heard in survey.topics():
        kinds = heard.kind
        if heard.values.get(""):
            kinds += f": {_examples(heard.values[''])}"
        here = ", ".join(names.get(heard.topic, ()))
        rows.append((heard.topic, str(heard.messages), kinds, here))
    if len(rows) > 1:
        yield from table(rows)
    else:
        yield "no messages came"
    if survey.passed_over:
        yield f"messages of further topics: {survey.passed_over}"


def _said(heard: "HeardTopic", sensor: "MqttSensor") -> str:
    """Return what was heard of a sensor, in a line."""
    plural = "" if heard.messages == 1 else "s"
    values = _examples(heard.values[sensor.field or ""])
    return f"{heard.messages} message{plural}: {values}"


def _examples(values: dict[str, None]) -> str:
    shown = [str(msgspec.json.decode(value)) for value in list(values)[:_SHOWN]]
    return ", ".join(shown) + (", ..." if len(values) > _SHOWN else "")


@init.command()
def keys(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            help="The folder to make them in; must not exist yet.",
        ),
    ],
    host: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A name or address under which other machines reach the hub. May be"
            " repeated.",
        ),
    ] = None,
    days: Annotated[int, typer.Option(help="How many days the keys are valid.")] = 365,
    form: Format = "text",
) -> None:
    """Make the keys and certificates of a swarm on several machines, for --tls."""
    from neurosnap.fabric.certificates import make_keys

    with errors():
        made = make_keys(folder, host or (), days=days)
        say(
            form,
            f"keys for {', '.join(made.roles)} in {made.folder}",
            f"the hub is {', '.join(made.hosts)}; valid until {made.until:%F}",
            "another machine needs ca.pem and the .pem and .key of its parts' roles",
        )
        print_facts(form, made)


@app.command()
def check(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="A TOML file that describes a run."),
    ],
    form: Format = "text",
) -> None:
    """Find all that would keep a run from starting, with line numbers."""
    from neurosnap.apps.config.load import load
    from neurosnap.apps.config.prepare import prepare
    from neurosnap.apps.config.problems import ConfigError

    with errors():
        try:
            prepare(load(file), listens=False)
        except ConfigError as error:
            faults = {"faults": error.faults, "more": error.more}
            print_facts(form, {"file": str(file), **faults})
            raise
        say(form, f"{file}: no faults")
        print_facts(form, {"file": str(file), "faults": [], "more": 0})


_BEGIN = """\
# What `neurosnap init topics` found at {address}. Delete what is of no use, name the rest as
# you like, and then: neurosnap run THIS_FILE

[source]
kind = "mqtt"
#stale_after = 3600          # seconds; a sensor that is silent for longer is unknown

[source.broker]
{broker}

[source.tick]                # a tick whenever a reading has changed, or
min_interval = 0.5           # seconds
max_interval = 60.0
{sensors}
[source.publish]             # beliefs, anomalies; Home Assistant sees them
prefix = "neurosnap"

[supervision]
restart_on_error = true
"""


def mqtt_file(
    broker: MqttBroker, sensors: Sequence[MqttSensor], said: Mapping[str, str]
) -> str:
    """Return the text of a file that describes a run on `sensors`.

    Args:
        broker: Where they are.
        sensors: One at least.
        said: What was heard of each, by its name, for a comment.
    """
    tables = ""
    for sensor in sensors:
        comment = "".join(a if a.isprintable() else "?" for a in said[sensor.name])
        tables += f"\n[[source.sensors]]  # {comment}\n{_keys(sensor)}\n"
    return _BEGIN.format(address=broker.address, broker=_keys(broker), sensors=tables)


def _keys(table: msgspec.Struct) -> str:
    """Return a line for each key that is not what it would be anyway."""
    lines = []
    for field in msgspec.structs.fields(table):
        value = getattr(table, field.name)
        if value != field.default or field.name == "host":
            # JSON's texts, numbers, lists and booleans are TOML's, except one letter.
            text = msgspec.json.encode(value).decode().replace("\x7f", "\\u007f")
            lines.append(f"{field.name} = {text}")
    return "\n".join(lines)
