"""Swarms that run are found by their id, and can be stopped by it alone."""

import os
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path

import msgspec
import psutil
import pytest

from neurosnap import wire
from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.runtime import registry
from neurosnap.sources.live.journal import Journal, JournalRow, journal_of
from tests.support.command_line import call, happy, refused
from tests.support.commands import Command
from tests.support.disturbed_commands import wait_for_size
from tests.support.patience import PATIENCE
from tests.support.recorded_messages import assert_true_run
from tests.support.swarm_processes import parts_of


def test_a_recording_is_held_by_one_process_and_the_other_is_told_which(
    tmp_path: Path,
) -> None:
    log = tmp_path / "a.mcap"
    rule = rf"^out: must be of one run at a time, and process {os.getpid()} has it, got"
    assert not registry.is_held(log)
    with registry.held(log, "out"):
        assert registry.is_held(log)
        with pytest.raises(InvalidValueError, match=rule), registry.held(log, "out"):
            pass
        assert str(log) in refused("run", "neurosnap/Path-v0", "--out", log)
        assert not log.exists()
    waiting = threading.Event()
    with ThreadPoolExecutor(1) as other:

        def follow() -> None:
            waiting.set()
            with registry.held(log, "out", PATIENCE):
                pass

        with registry.held(log, "out"):
            following = other.submit(follow)
            waiting.wait()
        following.result()


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of notes of this test's own."""
    folder = tmp_path / "runtime"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    return folder


@contextmanager
def going(log: Path) -> Iterator[Command]:
    """A swarm of five cells that goes on until it is stopped."""
    more = ("--ticks", "100000", "--set", "places=6", "--out", str(log))
    with Command("run", "neurosnap/Path-v0", *more) as process:
        wait_for_size(process, log, 20_000)
        yield process


@pytest.mark.zenoh
@pytest.mark.slow
def test_a_swarm_is_listed_shown_and_stopped(tmp_path: Path) -> None:
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    with going(first) as stopped, going(second) as left:
        listed = happy("ps")["swarms"]
        assert sorted(Path(one["log"]) for one in listed) == [first, second]
        ids = {Path(one["log"]): one["swarm"] for one in listed}
        pids = {Path(one["log"]): one["pid"] for one in listed}
        names = {who for who, _ in parts_of(psutil.Process(pids[first]))}
        services = {"hub", "recorder", "coordinator", "world"}
        assert names == services | {f"cell/{n}" for n in range(5)}
        assert happy("stop", ids[first])["log"] == str(first)
        stdout, stderr = stopped.communicate(timeout=PATIENCE)
        assert stopped.returncode == 0, stderr
        assert "as asked" in stdout
        assert left.poll() is None  # the other one goes on
        assert [one["swarm"] for one in happy("ps")["swarms"]] == [ids[second]]
    assert_true_run(first)


def test_what_is_not_there_is_named(runtime: Path) -> None:
    assert "swarm: must run on this machine, got 'abcd'" in refused("stop", "abcd")
    for verb in ("stop", "watch"):
        assert "swarm: must run on this machine, got 'none'" in refused(verb)
    assert call("ps").stdout == "no swarm runs here\n"


def test_a_note_is_there_while_its_swarm_is(runtime: Path) -> None:
    with registry.noted("abcd", "x.csv", "unixsock-stream//hub", None):
        (note,) = registry.swarms()
        assert (note.swarm, note.pid, note.log) == ("abcd", os.getpid(), "")
        assert registry.find("abcd") == note
    assert registry.swarms() == []
    assert list((runtime / "neurosnap").iterdir()) == []


def test_what_a_run_has_lost_is_listed_and_nothing_if_it_has_lost_nothing(
    tmp_path: Path,
) -> None:
    lossy, whole = tmp_path / "lossy.mcap", tmp_path / "whole.mcap"
    for log, received in (
        (lossy, wire.Received(shown=5, refused=4, dropped=2, outages=1)),
        (whole, wire.Received(shown=5)),
    ):
        with closing(Journal(journal_of(log), ["door"])) as journal:
            journal.write(JournalRow(0, b"\1", b"", received=received))
    with (
        registry.noted("abcd", "zenoh:", "", lossy),
        registry.noted("bcde", "-", "", whole),
        registry.noted("cdef", "-", "", None),
    ):
        assert [one["lost"] for one in happy("ps")["swarms"]] == [3, 0, 0]
        heads, *rows = (line.split()[2:] for line in call("ps").stdout.splitlines())
        registry.note_behind("3.0 s behind")
        assert all(
            "3.0 s behind" in line for line in call("ps").stdout.splitlines()[1:]
        )
        registry.note_behind("")
        assert "3.0 s behind" not in call("ps").stdout
    assert heads == ["source", "lost", "behind", "log"]
    assert [row[:2] for row in rows] == [["zenoh:", "3"], ["-", str(whole)], ["-"]]


@pytest.mark.slow
def test_a_second_run_of_one_id_is_refused(runtime: Path) -> None:
    code = (
        "import sys\n"
        "from neurosnap.runtime.registry import noted\n"
        "with noted('abcd', 'other.csv', 'its hub', None):\n"
        "    print(flush=True); sys.stdin.read()"
    )
    with Command("-c", code) as other:
        other.stdout.readline()
        rule = (
            rf"^swarm: must not be that of a run here, as of process {other.pid}, got"
        )
        with (
            pytest.raises(InvalidValueError, match=rule),
            registry.noted("abcd", "own.csv", "", None),
        ):
            pass
        assert registry.find("abcd").source == "other.csv"
        other.communicate(timeout=PATIENCE)
    assert registry.swarms() == []


def test_whoever_ends_before_being_asked_has_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with registry.noted("abcd", "x.csv", "", None):
        note = registry.find("abcd")

    def ended(process: psutil.Process) -> None:
        raise psutil.NoSuchProcess(process.pid)

    monkeypatch.setattr(psutil.Process, "terminate", ended)
    registry.stop(note, 0.0)  # must not end this process


def test_a_note_of_a_launcher_that_is_gone_counts_for_nothing(runtime: Path) -> None:
    with registry.noted("abcd", "x.csv", "unixsock-stream//hub", None):
        (note,) = registry.swarms()
        # Another process has that number now.
        other = msgspec.structs.replace(note, born=note.born - 1)
        path = runtime / "neurosnap" / f"abcd-{os.getpid()}.json"
        path.write_bytes(msgspec.json.encode(other))
        assert registry.swarms() == []
        assert not path.exists()
        registry.stop(other, 0.0)  # must not end this process
        (runtime / "neurosnap" / "torn.json").write_bytes(b'{"swarm": "to')
        assert registry.swarms() == []
        with pytest.raises(
            InvalidValueError, match=r"^swarm: must run on this machine"
        ):
            registry.find("abcd")


@pytest.mark.slow
def test_a_swarm_that_does_not_end_is_left_alone() -> None:
    code = (
        "import signal, sys\n"
        "signal.signal(15, signal.SIG_IGN)\n"
        "print(flush=True); sys.stdin.read()"
    )
    with Command("-c", code) as process:
        process.stdout.readline()
        born = psutil.Process(process.pid).create_time()
        note = registry.Note(
            swarm="abcd", pid=process.pid, born=born, source="", endpoint="", log=""
        )
        with pytest.raises(SwarmError, match=r"^swarm abcd: must end within 0.2 s"):
            registry.stop(note, 0.2)
        assert process.poll() is None


def test_a_folder_that_others_may_enter_is_refused(
    tmp_path: Path, runtime: Path
) -> None:
    (tmp_path / "mine").mkdir(mode=0o700)
    (runtime / "neurosnap").symlink_to(tmp_path / "mine")
    with pytest.raises(SwarmError, match="must be a folder of this user's own"):
        registry.swarms()
    (runtime / "neurosnap").unlink()
    (runtime / "neurosnap").mkdir()
    (runtime / "neurosnap").chmod(0o755)
    with pytest.raises(SwarmError, match=r"must be a folder of this .* got mode 755"):
        registry.swarms()
