"""``neurosnap health``: which sensors of a home seem broken, in readings there are."""

from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.data import Data, Sensors, Time, When, opened, wanted
from neurosnap.apps.cli.shared import Json, app, end_by, errors, print_json, say

_EXAMPLE = "Example: neurosnap health home-assistant_v2.db --alarms 1/month"


@app.command(epilog=_EXAMPLE)
def health(
    data: Data,
    alarms: Annotated[
        str,
        typer.Option(
            metavar="N/TIME",
            help="How many alarms the home may raise while nothing is wrong, such as"
            " 1/week or 2/month.",
        ),
    ] = "1/week",
    sensors: Sensors = None,
    when: When = None,
    time: Time = None,
    as_json: Json = False,
) -> None:
    """Tell which sensors of a home seem broken, since when, and why."""
    from neurosnap.apps import health_log
    from neurosnap.recording.read.recording import Recording

    with errors():
        there = opened(data, wanted(sensors, when, time))
        if isinstance(there, Recording):
            names = there.options.body.own
            observations = health_log.in_recording(there)
        else:
            names = there.columns.sensorium.names
            observations = health_log.in_table(there)
        found = health_log.follow(observations, names, alarms)
        console = say(as_json)
        for line in found.lines():
            console.print(line, markup=False, soft_wrap=True)
        if as_json:
            print_json(msgspec.to_builtins(found))
        if isinstance(there, Recording):
            end_by(there)
