"""Runs recorded from a made-up home in which a sensor breaks."""

from pathlib import Path

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from tests.support.lived_in import DAY, SENSORS, lived_in
from tests.support.recorded_runs import recorded

FLUSH = SENSORS.index("flush")
"""The sensor that rests."""


def broken_home(folder: Path) -> Path:
    """Record 17 days of a home whose flush rests from the fourteenth on.

    Observations come as they do in a home: whenever a sensor changes. They are in the
    table ``home.csv`` beside the recording, too.
    """
    spans = lived_in(17, 1)
    rests = spans[0][0] // DAY * DAY + 14 * DAY
    spans = [each for each in spans if each[2] != FLUSH or each[0] < rests]
    edges = sorted({at for on, off, _ in spans for at in (on, off)})
    rows = ["time," + ",".join(SENSORS)]
    for at in edges:
        on = {k for a, b, k in spans if a <= at < b}
        rows.append(f"{at}," + ",".join(str(int(k in on)) for k in range(len(SENSORS))))
    table = folder / "home.csv"
    table.write_text("\n".join(rows) + "\n", encoding="utf-8")
    options = RunOptions(
        source=str(table),
        body=Body(own=SENSORS),
        cells="inline",
        ticks=len(edges),
        alarms="1/week",
    )
    return recorded(options, folder / "home.mcap")
