"""``neurosnap learn``: the relations of sensors in readings that are there already."""

from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from neurosnap.apps.cli.data import Data, Sensors, Time, When, opened, wanted
from neurosnap.apps.cli.relations import MOST, Every, Force, Out
from neurosnap.apps.cli.shared import (
    Json,
    app,
    end_by,
    errors,
    print_json,
    say,
    screen,
)
from neurosnap.apps.cli.stopping import unwinding
from neurosnap.errors import InvalidValueError

if TYPE_CHECKING:
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.tables.readings import Readings

_BYTES_A_PAIR = 100
"""Of two sensors: their counts and what is judged of them. Measured: 85, of 2,000."""
_RULE = "by the table's own rule"
_EXAMPLE = "Example: neurosnap learn home-assistant_v2.db --out home.html"


@app.command(epilog=_EXAMPLE)
def learn(
    data: Data,
    out: Out = None,
    every: Every = False,
    threshold: Annotated[
        str | None,
        typer.Option(
            metavar="SHARE",
            help="Show what a run with this threshold learns, instead of what is sure:"
            " a number, or the word auto.",
        ),
    ] = None,
    sensors: Sensors = None,
    when: When = None,
    time: Time = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Tell which sensors imply which, in readings that are there already."""
    from neurosnap.apps.cli import output
    from neurosnap.apps.cli.options import as_share
    from neurosnap.apps.cli.relations import check_out, show, write
    from neurosnap.apps.export.relations import Answered
    from neurosnap.poc.learning.empirical import EmpiricalSnapshot
    from neurosnap.poc.learning.relation_table import tabulate
    from neurosnap.recording.read.recording import Recording

    with errors():
        if out is not None:
            check_out(out)
        found = opened(data, wanted(sensors, when, time))
        readings = _readings(found)
        _check_room(len(readings.columns.sensorium))
        with output.progress(screen, "pairs", None) as on_progress:
            fitted = None
            if threshold is not None:
                fitted = EmpiricalSnapshot.fit(
                    readings.columns, as_share(threshold), on_progress=on_progress
                )
            rows = tabulate(readings.columns, fitted, every, on_progress)
        learned = _RULE if threshold is None else f"threshold {threshold}"
        answered = Answered(str(data), readings, rows, learned)
        if out is not None:
            with unwinding():
                write(answered, out, data, force=force)
        show(say(as_json), answered, out, MOST)
        if not rows and threshold is None:
            say(as_json).print(
                "more readings may tell; --threshold shows what a run learns"
            )
        if as_json:
            print_json(msgspec.to_builtins(answered.facts()))
        if isinstance(found, Recording):
            end_by(found)


def _readings(found: "Recording | Readings") -> "Readings":
    """Return readings; of a recording those that it learned from."""
    from neurosnap.recording.read.observations import readings_of
    from neurosnap.recording.read.recording import Recording
    from neurosnap.recording.replay.learning import snapshot_at

    if not isinstance(found, Recording):
        return found
    tick, snapshot = snapshot_at(found)
    return readings_of(found, snapshot.sensorium, tick)


def _check_room(sensors: int) -> None:
    """Refuse more sensors than there is memory for all their pairs.

    Raises:
        InvalidValueError: There are more.
    """
    from neurosnap.system.resources import free_memory

    needed, free = _BYTES_A_PAIR * sensors * (sensors - 1) // 2, free_memory()
    if needed > free:
        rule = (
            f"must be fewer here: their pairs take {needed / 1e9:,.1f} GB, free are"
            f" {free / 1e9:.1f} GB (choose some with --sensors)"
        )
        raise InvalidValueError("sensors", rule, sensors)
