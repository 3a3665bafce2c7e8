"""A swarm of processes leaves nothing behind when it is killed or out of disk."""

import json
import tempfile
from pathlib import Path

import psutil
import pytest

from tests.support.command_line import call, flat
from tests.support.command_line_files import readings
from tests.support.disturbed_commands import (
    GROWN,
    finish,
    gone,
    sound,
    started,
    wait_for_size,
)

pytestmark = pytest.mark.slow


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    """A file of readings that takes longer than any test."""
    path = tmp_path / "endless.csv"
    path.write_text(readings(50_000), encoding="utf-8")
    return path


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
        with started("run", endless, "--out", log, folder=tmp_path) as process:
            wait_for_size(process, log, GROWN)
            family = psutil.Process(process.pid).children(recursive=True)
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
