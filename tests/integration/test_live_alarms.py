"""Alarms of a run on live readings, told while it goes on."""

import json
import time
from pathlib import Path

import numpy as np
import pytest

from neurosnap.apps.health_log import follow
from neurosnap.health.steps import STEP
from neurosnap.recording.read.observations import OwnReadings
from tests.support.command_line import call, happy
from tests.support.commands import Command
from tests.support.lived_in import SENSORS, START, lived_in
from tests.support.patience import PATIENCE
from tests.support.rewritten_recordings import sent_at
from tests.support.view_commands import verb

pytestmark = [pytest.mark.slow, pytest.mark.zenoh]

DAY = 86400
FLUSH = SENSORS.index("flush")
SILENT = "  flush: silent since "


def home() -> list[OwnReadings]:
    """Return the readings of a home whose flush rests from the fourteenth day on."""
    rests = START + 14 * DAY
    spans = [each for each in lived_in(18, 1) if each[2] != FLUSH or each[0] < rests]
    edges = sorted({at for on, off, _ in spans for at in (on, off)})
    known = np.ones(len(SENSORS), np.bool_)
    return [
        OwnReadings(
            at,
            np.isin(range(len(SENSORS)), [k for a, b, k in spans if a <= at < b]),
            known,
        )
        for at in edges
    ]


def line(on: np.ndarray) -> str:
    return json.dumps(
        {"bits": dict(zip(SENSORS, on.astype(int).tolist(), strict=True))}
    )


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of lines of standard input, as if it had ended yesterday.

    It ends within the ten minutes by whose end the flush is silent for too long.
    """
    folder = tmp_path_factory.mktemp("live")
    rows = home()
    silent = next(
        each.alarm
        for each in follow(rows, SENSORS, "1/week").alarms
        if each.alarm.sensor == "flush"
    )
    rows = [each for each in rows if each.at < (silent.step + 1) * STEP]
    log = folder / "home.mcap"
    with Command("run", "-", "--cells", "worker", "--out", log) as run:
        run.stdin.writelines(line(each.on) + "\n" for each in rows)
        _, errors = run.communicate(PATIENCE)
    assert run.returncode == 0, errors
    shift = int(time.time() - rows[-1].at) // DAY * DAY
    return sent_at(log, folder / "then.mcap", [each.at + shift for each in rows])


@pytest.mark.exhaustive
async def test_a_run_that_is_resumed_tells_an_alarm_once_and_so_do_those_who_look_on(
    recorded: Path, tmp_path: Path
) -> None:
    more = tmp_path / "more.mcap"
    resume = (
        "resume",
        str(recorded),
        "--ticks",
        "100000",
        "--out",
        str(more),
    )
    async with verb(tmp_path, *resume) as run:
        run.stdin.write((line(np.zeros(len(SENSORS), np.bool_)) + "\n").encode())
        said = ""
        while SILENT not in said:
            said = (await run.stderr.readline()).decode()
            assert said
        said = ""
        async with verb(tmp_path, "watch") as watch:
            while SILENT not in said:
                said = (await watch.stdout.readline()).decode()
                assert said
        output, errors = await run.communicate()
    assert run.returncode == 0, errors
    assert SILENT not in errors.decode()
    assert "in alarm: flush: silent since " in output.decode()
    watched = call("watch", more).stdout
    assert watched.count(SILENT) == 1
    told = [each["alarm"]["sensor"] for each in happy("health", more)["alarms"]]
    assert told.count("flush") == 1
