"""A swarm of processes ends in order when it is interrupted, killed or out of disk."""

import json
import os
import signal
import tempfile
from pathlib import Path

import pytest

from tests.support.command_line import call, flat, last_json
from tests.support.command_line_files import readings
from tests.support.disturbed_commands import (
    finish,
    going,
    gone,
    parts_of,
    sound,
    started,
)
from tests.support.exhaustive import rows

pytestmark = pytest.mark.slow


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    """A file of readings that takes longer than any test."""
    path = tmp_path / "endless.csv"
    path.write_text(readings(50_000), encoding="utf-8")
    return path


@pytest.mark.zenoh
@pytest.mark.parametrize(
    "number", rows([signal.SIGINT], [signal.SIGTERM]), ids=["INT", "TERM"]
)
def test_a_run_that_is_interrupted_ends_in_order(
    tmp_path: Path, endless: Path, number: signal.Signals
) -> None:
    log = tmp_path / "out.mcap"
    with going(endless, log) as (process, family):
        if number is signal.SIGINT:
            os.killpg(process.pid, number)  # as a terminal does: to all of them
        else:
            process.send_signal(number)
        code, stdout, stderr = finish(process)
        assert gone(family)
    assert code == 0, stderr
    facts = last_json(stdout)
    assert (facts["stopped"], facts["complete"]) == (True, True)
    verdict = sound(log)
    assert verdict.complete
    assert verdict.ticks == facts["ticks"] < 50_000


@pytest.mark.zenoh
def test_a_cell_that_is_killed_is_named(tmp_path: Path, endless: Path) -> None:
    log = tmp_path / "out.mcap"
    with going(endless, log, "--set", "supervision.max_restarts=0") as (
        process,
        family,
    ):
        *_, last = parts_of(family)
        last.kill()
        code, stdout, stderr = finish(process)
        assert gone(family)
    assert code == 1
    assert "cell/2" in stderr
    assert "cell/1" not in stderr
    assert "Traceback" not in stderr
    assert stdout == ""
    assert not sound(log).complete


@pytest.mark.zenoh
def test_a_launcher_that_is_killed_leaves_nothing(
    tmp_path: Path, endless: Path
) -> None:
    log = tmp_path / "out.mcap"
    with (
        tempfile.TemporaryDirectory(prefix="ns-") as folder,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setenv("TMPDIR", folder)
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
        with going(endless, log) as (process, family):
            assert len(family) >= 7  # hub, recorder, coordinator, world, cells
            process.kill()
            process.wait()
            assert gone(family)
        # The hub's socket, and the fork server's own.
        left = [path.name for path in Path(folder).iterdir()]
    assert left == []
    sound(log)


@pytest.mark.zenoh
def test_a_full_disk_is_named_and_what_is_there_is_readable(
    tmp_path: Path, endless: Path
) -> None:
    log = tmp_path / "out.mcap"
    most = 100_000

    arguments = ("run", endless, "--out", log, "--format", "json")
    with started(*arguments, folder=tmp_path, largest=most) as process:
        code, stdout, stderr = finish(process)
    assert code == 3, stderr
    assert not json.loads(stdout.splitlines()[-1])["complete"]
    assert "must take what is recorded, got File too large for" in flat(stderr)
    assert "Traceback" not in stderr
    assert log.stat().st_size <= most
    assert not sound(log).complete
    assert call("verify", log).exit_code == 3
    assert call("info", log).exit_code == 3
