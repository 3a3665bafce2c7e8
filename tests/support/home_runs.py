"""Runs recorded from a made-up home in which a sensor breaks."""

from pathlib import Path

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from tests.support.lived_in import DAY, SENSORS, lived_in
from tests.support.recorded_runs import recorded
from tests.support.rewritten_recordings import sent_at

FLUSH = SENSORS.index("flush")
"""The sensor that rests."""


def broken_home(folder: Path) -> Path:
    """Record 17 days of a home whose flush rests from the fourteenth on.

    Observations come as they do in a home: whenever a sensor changes.
    """
    spans = lived_in(17, 1)
    rests = spans[0][0] // DAY * DAY + 14 * DAY
    spans = [each for each in spans if each[2] != FLUSH or each[0] < rests]
    edges = sorted({at for on, off, _ in spans for at in (on, off)})
    rows = [
        ",".join(
            str(int(sensor in {k for a, b, k in spans if a <= at < b}))
            for sensor in range(len(SENSORS))
        )
        for at in edges
    ]
    table = folder / "home.csv"
    table.write_text("\n".join([",".join(SENSORS), *rows]) + "\n", encoding="utf-8")
    options = RunOptions(
        source=str(table),
        body=Body(own=SENSORS),
        cells="inline",
        ticks=len(rows),
        alarms="1/week",
    )
    return sent_at(recorded(options, folder / "home.mcap"), folder / "then.mcap", edges)
