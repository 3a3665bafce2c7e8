"""``neurosnap ros2``: what a graph of ROS 2 has, and a file to begin with."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    Force,
    Format,
    convert,
    errors,
    run_async,
)
from neurosnap.apps.cli.init import TomlFile, check_free
from neurosnap.apps.cli.terminal_output import print_facts, say, table, warn
from neurosnap.errors import MissingExtraError, NeurosnapError
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.sensorium import visible
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.tick_schedule import OnChange
from neurosnap.sources.ros2.options import ROUTER, Ros2Options
from neurosnap.system.distribution import must_have

if TYPE_CHECKING:
    from neurosnap.sources.ros2.topic_survey import Ros2Survey

ros2 = typer.Typer(help="Listen to the robots of ROS 2.", no_args_is_help=True)
app.add_typer(ros2, name="ros2")


@ros2.callback()
def _group() -> None:
    """Listen to the robots of ROS 2."""


@ros2.command(epilog="Example: neurosnap ros2 discover --out robot.toml")
def discover(
    router: Annotated[
        str, typer.Option(metavar="ENDPOINT", help="Where the graph's router is.")
    ] = ROUTER,
    domain: Annotated[
        int, typer.Option(min=0, max=232, help="The domain (ROS_DOMAIN_ID).")
    ] = 0,
    through: Annotated[
        Literal["zenoh", "rclpy"],
        typer.Option(help="Zenoh, or rclpy with the middleware that it has."),
    ] = "zenoh",
    seconds: Annotated[
        float,
        typer.Option(
            min=0.1, max=86_400, help="How long to listen; Ctrl-C ends it earlier."
        ),
    ] = 10.0,
    out: TomlFile = None,
    force: Force = False,
    form: Format = "text",
) -> None:
    """List the nodes and topics of a graph of ROS 2, and write a file to begin with."""
    with errors():
        # What is listened to is found; there must be one name to begin with.
        given = {"router": router, "domain": domain, "sensors": ("/all",)}
        options = convert(Ros2Options, **given, through=through)
        check_free(out, force=force)
        nodes, survey = _listened(options, seconds)
        say(form, f"nodes: {', '.join(map(visible, nodes)) or 'none'}")
        say(form, *_lines(survey))
        count = sum(len(list(survey.sensors(topic))) for topic in survey.publishers)
        if out is not None:
            _write(out, survey, count, force=force)
            say(form, f"wrote {out} with {count} sensors; read it, then:")
            say(form, f"neurosnap run {out}")
        print_facts(form, {**_facts(nodes, survey), "out": out and str(out)})


def _listened(options: Ros2Options, seconds: float) -> tuple[list[str], "Ros2Survey"]:
    """Return the nodes, and what came in so many seconds or until Ctrl-C."""
    try:
        from neurosnap.sources.ros2.graph import GraphWatch, open_session
        from neurosnap.sources.ros2.through_rclpy import graph_through_rclpy
        from neurosnap.sources.ros2.topic_survey import (
            RclpySurveyFeeder,
            Ros2Survey,
            SurveyFeeder,
        )
    except ImportError as error:  # an extra
        rule = must_have(error.name or "rosbags", "ros2")
        raise MissingExtraError(f"ros2: {rule}") from error
    if by_rclpy := options.through == "rclpy":
        graph = graph_through_rclpy(options.domain)
    else:
        with open_session(options.router) as session:
            watch = GraphWatch(session, options.domain)
            watch.close()
        graph = watch.graph
    survey = Ros2Survey(graph, options)
    nodes = [node.path for node in graph.nodes]
    if not survey.publishers:
        return nodes, survey
    feeder = RclpySurveyFeeder(survey) if by_rclpy else SurveyFeeder(survey)
    source = LiveSource(LatestReadings(["-"]), OnChange(), feeder=feeder)
    source.readers = survey
    source.over = True  # nothing need be kept for a process that goes on with it
    where = "through rclpy" if by_rclpy else f"at {options.router}"
    warn(f"listening {where} for {seconds:g} s (or Ctrl-C)")

    async def work(stop: asyncio.Event) -> None:
        heard = asyncio.create_task(asyncio.to_thread(source.first), name="ros2/heard")
        heard.add_done_callback(lambda _: stop.set())
        await wait_any(stop, seconds=seconds)
        await asyncio.to_thread(source.close)
        await heard

    run_async(work)
    return nodes, survey


def _write(out: Path, survey: "Ros2Survey", count: int, *, force: bool) -> None:
    """Write a file that runs on what was found."""
    from neurosnap.sources.ros2.topic_survey import ros2_file

    if not count:
        rule = "must have a topic that says something fit for a sensor"
        raise NeurosnapError(f"graph: {rule}, got none in what came")
    with out.open("w" if force else "x", encoding="utf-8") as file:
        file.write(ros2_file(survey))


def _lines(survey: "Ros2Survey") -> Iterator[str]:
    """List the topics, and what their fields said."""
    rows = [("topic", "type", "messages", "a second", "published by")]
    for topic, each in survey.publishers.items():
        period, count = survey.period(topic), str(survey.counts[topic])
        often = f"{1 / period:.3g}" if period else ""
        names = ", ".join(dict.fromkeys(one.node.path for one in each))
        types = ", ".join(dict.fromkeys(one.type for one in each))
        rows.append((topic, types, count, often, names))
    if len(rows) == 1:
        yield "no topics are published"
        return
    yield from table(rows)
    yield ""
    said = [("field", "says")]
    for topic in survey.publishers:
        said += [(name, signal.says()) for name, signal in survey.fields(topic)]
    yield from table(said)


def _facts(nodes: list[str], survey: "Ros2Survey") -> dict[str, object]:
    return {
        "nodes": nodes,
        "topics": [
            {
                "topic": topic,
                "type": each[0].type,
                "messages": survey.counts[topic],
                "period": survey.period(topic),
                "publishers": [one.node.path for one in each],
                "sensors": [found.text for found in survey.sensors(topic)],
            }
            for topic, each in survey.publishers.items()
        ],
    }
