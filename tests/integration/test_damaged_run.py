"""A disk that damages the recording of a run, and takes it away, while it runs."""

import json
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from neurosnap.errors import RecordingError
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime import launch
from neurosnap.runtime.request import Restart
from tests.support.commands import Command
from tests.support.disturbed_runs import ENDLESS, Disturbed, options_for

pytestmark = [pytest.mark.slow, pytest.mark.zenoh, pytest.mark.timeout(300)]

PATIENCE = 120.0  # seconds


class Fed:
    """A run of standard input that is given one line after the other."""

    def __init__(self, process: Command, log: Path) -> None:
        self.process = process
        self.log = log

    def feed(self, until: Callable[[], bool]) -> None:
        """Write lines until something holds, and few: each is a tick before the end."""
        deadline, number = time.monotonic() + PATIENCE, 0
        while not until():
            assert time.monotonic() < deadline
            for _ in range(5):
                number += 1
                bits = [number >> bit & 1 for bit in range(3)]
                self.process.stdin.write(json.dumps({"bits": bits}) + "\n")
            self.process.stdin.flush()
            time.sleep(0.05)

    def kill(self, name: str) -> None:
        """Kill a part; return once it has gone."""
        children = psutil.Process(self.process.pid).children(recursive=True)
        (victim,) = [child for child in children if child.name() == name]
        victim.send_signal(signal.SIGKILL)
        victim.wait(PATIENCE)

    def end(self) -> tuple[dict[str, object], str]:
        """End the input; return what the run said, and its errors."""
        out, errors = self.process.communicate(timeout=PATIENCE)
        return json.loads(out.splitlines()[-1]), errors


@contextmanager
def fed(log: Path, *more: str) -> Iterator[Fed]:
    command = [
        "run",
        "-",
        "--format",
        "json",
        "--set",
        "sensors=a,b,c",
        "--out",
        str(log),
    ]
    with Command(
        *command, "--set", "supervision.backoff=0", *more, buffer=4096
    ) as process:
        yield Fed(process, log)


class Mourning(Disturbed):
    """Looks, each time the run goes on, whether the recorder had ended in order."""

    def __init__(self, log: Path) -> None:
        super().__init__(options_for(ENDLESS), log)
        self.finished: list[bool] = []
        self.restarts = _Told(self._look)

    def _look(self) -> None:
        self.finished.append(Recording.open(f"{self._log}.broken").cut is None)


class _Told(list[Restart]):
    """Calls somebody for each restart."""

    def __init__(self, call: Callable[[], None]) -> None:
        super().__init__()
        self._call = call

    def append(self, restart: Restart) -> None:
        super().append(restart)
        self._call()


def test_a_recorder_without_a_hub_writes_down_what_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(launch, "_LAST_WRITE", PATIENCE)
    mourning = Mourning(tmp_path / "log")
    mourning.run((20, ("hub",)))
    assert mourning.finished == [True]


def chunks(log: Path) -> int:
    """Return how many whole chunks of a recording are on the disk."""
    try:
        return len(Recording.open(log).files[0].layout.chunks)
    except RecordingError:
        return 0


def test_a_damaged_recording_is_kept_and_told_of(tmp_path: Path) -> None:
    log, kept = tmp_path / "a.mcap", tmp_path / "a.damaged-1.mcap"
    with fed(log) as running:
        running.feed(lambda: chunks(log) >= 3)
        place = Recording.open(log).files[0].layout.chunks[0].offset + 20
        with log.open("r+b") as file:
            file.seek(place)
            (byte,) = file.read(1)
            file.seek(place)
            file.write(bytes([byte ^ 1]))
        running.kill("cell/1")
        # Lines go to the next life, too, once it has come up.
        running.feed(lambda: kept.exists() or (tmp_path / "a.mcap.broken").exists())
        running.feed(lambda: chunks(log) >= 2)
        said, errors = running.end()
    assert running.process.returncode == 3, errors
    assert said["complete"] is False
    assert said["kept"] == [str(kept)]
    assert "going on from tick" in errors
    with kept.open("rb") as file:
        file.seek(place)
        assert file.read(1) == bytes([byte ^ 1])
    # What came in is kept, too: ticks of the damaged file may be in no other.
    journal = tmp_path / "a.mcap.journal"
    assert said["journal"] == str(journal)
    assert sorted(tmp_path.iterdir()) == [kept, log, journal]


def test_a_recording_deleted_while_it_runs_is_told_of_and_copied(
    tmp_path: Path,
) -> None:
    log = tmp_path / "a.mcap"
    with fed(log) as running:
        running.feed(lambda: chunks(log) >= 2)
        log.unlink()
        said, errors = running.end()
    assert running.process.returncode == 3, errors
    assert said["complete"] is False
    assert "must stay where it is while it is written" in errors
    observed = list(Recording.open(log).messages(("observation",)))
    assert len(observed) == said["ticks"]
