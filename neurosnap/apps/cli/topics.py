"""``neurosnap topics``: what comes at a broker, and a TOML file that reads it."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from rich.markup import escape
from rich.table import Table

from neurosnap.apps.cli.broker import host_and_port
from neurosnap.apps.cli.options import FLAG
from neurosnap.apps.cli.shared import (
    Json,
    app,
    convert,
    errors,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError, MissingExtraError, NeurosnapError
from neurosnap.fabric.events import wait_any, wait_at_most
from neurosnap.sensorium import visible
from neurosnap.sources.mqtt.options import MqttBroker
from neurosnap.system.distribution import must_have

if TYPE_CHECKING:
    from rich.console import Console

    from neurosnap.sources.mqtt.options import MqttSensor
    from neurosnap.sources.mqtt.topic_survey import Heard, Survey

_SHOWN = 3  # values of a topic in a line
_EXAMPLE = "Example: neurosnap topics homeassistant.local --out home.toml"


@app.command(epilog=_EXAMPLE)
def topics(
    host: Annotated[
        str, typer.Argument(metavar="HOST[:PORT]", help="Where the broker is.")
    ],
    seconds: Annotated[
        float,
        typer.Option(min=0.1, max=86_400, help="Listen for so long; or until Ctrl-C."),
    ] = 60.0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a TOML file that makes sensors of what looks like them.",
            show_default="only list the topics",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", metavar=FLAG, help="Replace FILE if it is there.")
    ] = False,
    topic: Annotated[
        str,
        typer.Option(metavar="FILTER", help="Listen to these topics only (home/#)."),
    ] = "#",
    username: Annotated[
        str | None, typer.Option(help="The name to give to the broker.")
    ] = None,
    password_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="A file whose first line is the password to it."
        ),
    ] = None,
    tls: Annotated[
        bool, typer.Option("--tls", metavar=FLAG, help="Encrypt the connection.")
    ] = False,
    ca_file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Trust these certificates (PEM) only."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Listen at an MQTT broker, list its topics, and write a file to begin with."""
    from neurosnap.apps.config.mqtt_file import mqtt_file
    from neurosnap.sources.mqtt.options import is_filter

    with errors():
        # A file that is run looks for its own files from its own folder.
        files = {"password_file": password_file, "ca_file": ca_file}
        found = {k: str(v.absolute()) for k, v in files.items() if v is not None}
        where = host_and_port(host, "HOST or HOST:PORT")
        broker = convert(MqttBroker, **where, username=username, tls=tls, **found)
        if not is_filter(topic):
            rule = "must be a topic filter, + or # alone in a level and # in the last"
            raise InvalidValueError("topic", rule, topic)
        if out is not None:
            _check_free(out, force=force)
        survey = _listened(broker, topic, seconds)
        sensors = survey.sensors()
        _show(say(as_json), survey, sensors)
        if out is not None:
            if not sensors:
                rule = "must have a topic that looks like a sensor"
                raise NeurosnapError(f"broker: {rule}, got none in what came")
            by_topic = {heard.topic: heard for heard in survey.topics()}
            said = {each.name: _said(by_topic[each.topic], each) for each in sensors}
            text = mqtt_file(broker, sensors, said)
            with out.open("w" if force else "x", encoding="utf-8") as file:
                file.write(text)
            check = f"wrote {out} with {len(sensors)} sensors; look at it, then: "
            run = f"neurosnap run {out}"
            say(as_json).print(check + run, markup=False, soft_wrap=True)
        if as_json:
            print_json(
                {
                    "topics": [
                        {"topic": h.topic, "messages": h.messages, "kind": h.kind}
                        for h in survey.topics()
                    ],
                    "sensors": [
                        {"name": s.name, "topic": s.topic, "field": s.field}
                        for s in sensors
                    ],
                    "passed_over": survey.passed_over,
                    "out": None if out is None else str(out),
                }
            )


def _check_free(out: Path, *, force: bool) -> None:
    if out.suffix.lower() != ".toml":
        raise InvalidValueError("out", "must end with .toml", str(out))
    if out.exists() and not force:
        rule = "must not be there yet (--force replaces it)"
        raise InvalidValueError("out", rule, str(out))
    if not out.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that is there", str(out))


def _listened(broker: MqttBroker, topic: str, seconds: float) -> "Survey":
    """Return what came at `broker` in so many seconds, or until Ctrl-C."""
    try:
        from neurosnap.sources.mqtt.connection import MqttLink
    except ImportError as error:  # an extra
        rule = must_have(error.name or "aiomqtt", "mqtt")
        raise MissingExtraError(f"topics: {rule}") from error
    from neurosnap.sources.mqtt.topic_survey import Survey

    survey = Survey()

    def receive(name: str, data: bytes, _retained: bool) -> None:
        if survey.take(name, data):
            screen.print(f"heard {visible(name)}", markup=False, soft_wrap=True)

    async def work(stop: asyncio.Event) -> None:
        there = asyncio.Event()

        def connected(on: bool) -> None:
            if on and not there.is_set():
                there.set()
                text = f"listening at {broker.address} for {seconds:g} s (or Ctrl-C)"
                screen.print(text, markup=False, soft_wrap=True)

        link = MqttLink(
            broker, "topics", filters=[topic], receive=receive, connected=connected
        )
        over = asyncio.Event()
        serving = asyncio.create_task(link.serve(over), name="topics/serve")
        serving.add_done_callback(lambda _: stop.set())
        await wait_any(there, stop)
        await wait_at_most(stop, seconds)
        over.set()
        await serving

    run_async(work)
    return survey


def _show(console: "Console", survey: "Survey", sensors: "list[MqttSensor]") -> None:
    """List the topics, and say which are sensors."""
    names: dict[str, list[str]] = {}
    for sensor in sensors:
        names.setdefault(sensor.topic, []).append(sensor.name)
    table = Table("topic", "messages", "payloads", "sensors", box=None, pad_edge=False)
    for heard in survey.topics():
        kinds = heard.kind
        if heard.values.get(""):
            kinds += f": {_examples(heard.values[''])}"
        here = ", ".join(names.get(heard.topic, ()))
        row = (heard.topic, str(heard.messages), kinds, here)
        table.add_row(*(escape(visible(cell)) for cell in row))
    if survey.topics():
        console.print(table)
    else:
        console.print("no topic said anything")
    if survey.passed_over:
        console.print(f"messages of further topics: {survey.passed_over}")


def _said(heard: "Heard", sensor: "MqttSensor") -> str:
    """Return what was heard of a sensor, in a line."""
    plural = "" if heard.messages == 1 else "s"
    values = _examples(heard.values[sensor.field or ""])
    return f"{heard.messages} message{plural}: {values}"


def _examples(values: dict[str, None]) -> str:
    shown = [str(msgspec.json.decode(value)) for value in list(values)[:_SHOWN]]
    return ", ".join(shown) + (", ..." if len(values) > _SHOWN else "")
