"""Readings survive the end of their swarm, and a damaged recording is kept."""

import asyncio
import json
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path

import aiomqtt
import psutil
import pytest

from neurosnap import wire
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.errors import RecordingError
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime import launch
from neurosnap.runtime.child_processes import END
from neurosnap.runtime.request import Restart
from neurosnap.sensorium import unpack
from neurosnap.sources.live.journal import JournalRow, journal_of, read_journal
from tests.support.commands import Command
from tests.support.disturbed_runs import ENDLESS, Disturbed, options_for
from tests.support.exhaustive import rows
from tests.support.mosquitto import Mosquitto, heard, needs_mosquitto, peer, started
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.recorded_messages import assert_true_run
from tests.support.senders import by_zenoh
from tests.support.swarm_processes import parts_of

pytestmark = [pytest.mark.slow, pytest.mark.zenoh, pytest.mark.timeout(600)]
BITS = 6  # as wide as the numbers of the lines are shown: they are counted modulo
SENSORS = ",".join(f"bit{place}" for place in range(BITS))


class Fed:
    """A run of its own process, which reads lines that say how many they are."""

    def __init__(self, log: Path, process: Command) -> None:
        self.log = log
        self.process = process
        self._number = 0

    def feed(self, count: int) -> None:
        for _ in range(count):
            self._number += 1
            self._write(
                {f"bit{place}": self._number >> place & 1 for place in range(BITS)}
            )

    def _write(self, bits: dict[str, int]) -> None:
        self.process.stdin.write(json.dumps({"bits": bits}) + "\n")
        self.process.stdin.flush()

    def feed_until(self, condition: Callable[[], bool]) -> None:
        """Write lines until something holds, and few: each is a tick before the end."""

        def holds() -> bool:
            self.feed(0 if condition() else 5)
            return condition()

        until(holds)

    def wait_for(self, tick: int) -> None:
        def is_there() -> bool:
            assert self.process.poll() is None, self.end()
            return len(recorded(self.log)) >= tick

        until(is_there)

    def wait_for_row(self, line: int) -> None:
        until(lambda: any(row.number == line for row in rows_of(self.log)))

    def kill(self, who: str) -> None:
        parts(self.process)[who].send_signal(signal.SIGKILL)

    def wait_for_restart(self) -> None:
        for line in self.process.stderr:
            if line.startswith("going on from tick"):
                return
        raise AssertionError("the run ended")

    def end(self) -> tuple[int, str]:
        said, errors = self.process.communicate(timeout=PATIENCE)
        return self.process.wait(), said + errors

    def told(self) -> tuple[dict[str, object], str]:
        """End the input; return what the run said in JSON, and its errors."""
        said, errors = self.process.communicate(timeout=PATIENCE)
        return json.loads(said.splitlines()[-1]), errors


class Put(Fed):
    """A run that listens to a stock Zenoh program."""

    def __init__(self, log: Path, process: Command, endpoint: str) -> None:
        super().__init__(log, process)
        self._send = by_zenoh(endpoint, "home")

    def _write(self, bits: dict[str, int]) -> None:
        self._send({"bits": bits})

    def end(self) -> tuple[int, str]:
        self.process.send_signal(signal.SIGINT)
        return super().end()


def until(condition: Callable[[], bool]) -> None:
    latest = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < latest
        time.sleep(0.1)


def parts(process: Command) -> dict[str, psutil.Process]:
    return dict(parts_of(psutil.Process(process.pid)))


def recorded(log: Path) -> list[int]:
    """Return the numbers of the lines that are recorded by now."""
    try:
        messages = [r.message for r in Recording.open(log).messages(("observation",))]
    except (RecordingError, OSError):
        return []
    return [
        sum(int(bit) << place for place, bit in enumerate(unpack(m.bits, BITS)))
        for m in messages
        if isinstance(m, wire.Observation)
    ]


def counted(lines: int) -> list[int]:
    """Return what so many lines say that they are."""
    return [number % 2**BITS for number in range(1, lines + 1)]


def rows_of(log: Path) -> tuple[JournalRow, ...]:
    return read_journal(journal_of(log)).rows


@contextmanager
def neurosnap(log: Path, *arguments: str) -> Iterator[Fed]:
    with Command(*arguments) as process:
        yield Fed(log, process)


def running(log: Path, *more: str) -> AbstractContextManager[Fed]:
    flags = ("--ticks", "3000", "--set", f"sensors={SENSORS}")
    more = (*flags, "--set", "supervision.backoff=0", *more)
    return neurosnap(log, "run", "-", "--out", str(log), *more)


def test_whichever_part_dies_every_line_is_a_tick_once_and_in_order(
    tmp_path: Path,
) -> None:
    log, lines = tmp_path / "lines.mcap", 10
    with running(log, "--cells", "worker") as run:
        run.feed(lines)
        run.wait_for(8)
        for victim in ("worker/1", "hub", "recorder", "coordinator", "world", "intake"):
            run.feed(15)  # most have no tick when it dies
            lines += 15
            if victim == "intake":
                # What it has read and not yet written dies with it.
                run.wait_for_row(lines)
            run.kill(victim)
            run.feed(10)  # while no part is there to read them
            lines += 10
            run.wait_for_restart()
            run.wait_for(lines - 5)
        status, said = run.end()
    # What the intake had read and not written may be lost with it: here it was not.
    assert status == 3, said
    assert f"{lines} received = {lines} in ticks\n" in said
    assert "could not listen 1 times" in said
    info = "\n".join(render(describe(Recording.open(log))))
    assert f"{lines} received = {lines} in ticks\n" in info
    assert re.search("did not listen from .+ to .+: intake: ", info)
    assert recorded(log) == counted(lines)
    assert_true_run(log, ticks=lines)
    assert [path.name for path in tmp_path.iterdir()] == ["lines.mcap"]


def test_what_programs_put_while_no_swarm_is_up_is_not_lost(tmp_path: Path) -> None:
    log, endpoint = tmp_path / "put.mcap", f"tcp/127.0.0.1:{free_port()}"
    flags = ["--cells", "worker", "--swarm", "home", "--listen", endpoint]
    flags += ["--set", f"sensors={SENSORS}", "--set", "supervision.backoff=0"]
    with Command("run", "zenoh:", "--out", str(log), *flags) as process:
        run, lines = Put(log, process, endpoint), 0
        for victim in ("worker/1", "recorder", "coordinator", "world"):
            run.feed(15)
            run.wait_for(lines + 8)
            run.kill(victim)
            run.feed(25)  # while no part is there to read them
            lines += 40
            run.wait_for_restart()
            run.wait_for(lines)
        status, said = run.end()
    assert status == 0, said
    assert f"{lines} received = {lines} in ticks\n" in said
    assert recorded(log) == counted(lines)
    assert verify(log).complete


def test_what_is_recorded_is_cut_off(tmp_path: Path) -> None:
    log = tmp_path / "lines.mcap"
    often = ("--set", "recording.keyframe_every=10")
    with running(log, "--cells", "inline", *often) as run:
        run.feed(300)  # a file of the journal holds 256
        until(lambda: (rows := rows_of(log)) != () and rows[0].number > 1)
        first = rows_of(log)[0].number
        assert first <= len(recorded(log))
        status, said = run.end()
    assert status == 0, said
    assert recorded(log) == counted(300)
    assert not journal_of(log).exists()


@contextmanager
def held(coordinator: psutil.Process, asked: bool) -> Iterator[None]:
    """Let no tick be made in the block; nor later, if one is `asked` to end there."""

    def is_asked() -> bool:
        status = Path(f"/proc/{coordinator.pid}/status").read_text().splitlines()
        (waiting,) = (line.split()[1] for line in status if line.startswith("ShdPnd"))
        return bool(int(waiting, 16) >> (END - 1) & 1)

    coordinator.suspend()
    try:
        yield
        if asked:
            until(is_asked)
    finally:
        coordinator.resume()


@pytest.mark.parametrize(
    ("cells", "end"),
    rows(
        [("process", signal.SIGKILL), ("inline", signal.SIGINT)],
        [("process", signal.SIGINT), ("inline", signal.SIGKILL)],
    ),
)
def test_a_run_that_is_resumed_gets_what_had_no_tick(
    end: signal.Signals, cells: str, tmp_path: Path
) -> None:
    log, new = tmp_path / "lines.mcap", tmp_path / "on.mcap"
    with running(log, "--cells", cells) as run:
        run.feed(10)
        run.wait_for(10)
        children = psutil.Process(run.process.pid).children(recursive=True)
        if cells == "inline":  # it is all one process, which cannot be held
            run.feed(990)
            run.wait_for(30)
            run.process.send_signal(end)
        else:
            coordinator, world = (
                parts(run.process)[who] for who in ("coordinator", "world")
            )
            with held(coordinator, asked=end == signal.SIGINT):
                run.feed(30)
                until(lambda: rows_of(log)[-1].number == 40)
                run.process.send_signal(end)
                if end == signal.SIGKILL:  # or it might go through all of them first
                    world.wait(PATIENCE)
        _, said = run.end()
        psutil.wait_procs(children, timeout=PATIENCE)
    kept = rows_of(log)
    lines = 1000 if cells == "inline" else 40
    assert verify(log).ticks < kept[-1].number <= lines
    if end == signal.SIGINT:
        waiting = kept[-1].number - verify(log).ticks
        assert f"+ {waiting} kept for a resumed run" in said
        assert str(journal_of(log)) in said.replace("\n", "")
    total = lines + 5
    go_on = ("resume", str(log), "--ticks", str(total), "--out", str(new))
    with neurosnap(new, *go_on) as run:
        run._number = kept[-1].number
        run.feed(total - kept[-1].number)
        status, said = run.end()
    assert status == 0, said
    assert recorded(new) == counted(total)
    assert verify(new).same
    assert journal_of(log).exists()  # it is that recording's, which is as it was
    assert not journal_of(new).exists()


def test_a_journal_of_an_earlier_run_is_not_written_into(tmp_path: Path) -> None:
    log = tmp_path / "lines.mcap"
    journal_of(log).mkdir()
    with running(log) as run:
        status, said = run.end()
    assert status == 2
    assert "journal: must be taken away first" in said


HOUSE = """
[source]
kind = "mqtt"
sensors = [
{sensors}
]
[source.broker]
host = "127.0.0.1"
port = {port}
[source.tick]
min_interval = 0
"""
BIT = '  {{ name = "bit{0}", topic = "count", field = "bit{0}" }},'


@needs_mosquitto
@pytest.mark.parametrize("victim", rows(["world"], ["cell/3", "hub"]))
async def test_each_change_that_a_broker_told_of_meanwhile_is_a_tick(
    victim: str, tmp_path: Path
) -> None:
    log, file = tmp_path / "house.mcap", tmp_path / "house.toml"
    with started(tmp_path, "allow_anonymous true") as broker:
        lines = "\n".join(BIT.format(place) for place in range(BITS))
        file.write_text(HOUSE.format(sensors=lines, port=broker.port))
        swarm = ("--cells", "process", "--set", "supervision.backoff=3")
        arguments = ("run", str(file), "--out", str(log), *swarm)
        with neurosnap(log, *arguments) as run:
            await asyncio.to_thread(until, lambda: log.exists())
            await publish_all(broker, run, victim)
            run.process.send_signal(signal.SIGINT)
            status, said = await asyncio.to_thread(run.end)
    assert status == 0, said
    assert recorded(log) == counted(30)
    assert verify(log).same
    assert not journal_of(log).exists()


@needs_mosquitto
@pytest.mark.parametrize("victim", ["intake", "run"])
async def test_what_is_published_meanwhile_comes_once_the_run_listens_again(
    victim: str, tmp_path: Path
) -> None:
    log, file = tmp_path / "house.mcap", tmp_path / "house.toml"
    more, new = "[source.publish]\nprefix = 'said'\n", tmp_path / "on.mcap"
    going_on = ("resume", str(log), str(file), "--out", str(new))
    with started(tmp_path, "allow_anonymous true") as broker:
        lines = "\n".join(BIT.format(place) for place in range(BITS))
        file.write_text(HOUSE.format(sensors=lines, port=broker.port) + more)
        with neurosnap(log, "run", str(file), "--out", str(log)) as run:
            async with peer(broker, "said/world/status") as other:
                await heard(other, "said/world/status", b"online")
                for number in range(1, 6):
                    await publish(other, number)
                    await asyncio.to_thread(run.wait_for, number)
                intake = parts(run.process)["intake"]
                intake.suspend()
                for number in range(6, 56):
                    await publish(other, number)
                (run.process if victim == "run" else intake).send_signal(signal.SIGKILL)
                intake.send_signal(signal.SIGKILL)
            goes_on: AbstractContextManager[Fed] = nullcontext(run)
            if victim == "run":
                await asyncio.to_thread(run.end)
                goes_on = neurosnap(new, *going_on)
            with goes_on as last:
                await asyncio.to_thread(until, lambda: 55 in recorded(last.log))
                last.process.send_signal(signal.SIGINT)
                status, said = await asyncio.to_thread(last.end)
    assert status == (0 if victim == "run" else 3), said
    found = re.search(r"readings: (\d+) received = (\d+) in ticks\n", said)
    assert found is not None, said
    # The broker may not have been told of the five before, so that they come again.
    assert found[1] == found[2] in map(str, range(55, 61))


async def publish(client: aiomqtt.Client, number: int, *, retain: bool = False) -> None:
    said = {f"bit{place}": number >> place & 1 for place in range(BITS)}
    await client.publish("count", json.dumps(said), qos=1, retain=retain)


async def publish_all(broker: Mosquitto, run: Fed, victim: str) -> None:
    """Publish numbers, each once the one before is recorded, but for a restart."""
    async with peer(broker) as other:

        async def seen(number: int) -> None:
            await asyncio.to_thread(run.wait_for, number)

        await publish(other, 1, retain=True)  # the world may not listen yet
        await seen(1)
        for number in range(2, 11):
            await publish(other, number)
            await seen(number)
        world = parts(run.process)["world"]
        run.kill(victim)
        await asyncio.to_thread(world.wait, PATIENCE)
        for number in (11, 12):  # 11 may still answer what the world asked before
            await publish(other, number)
            await asyncio.to_thread(run.wait_for_row, number)
        for number in range(13, 21):  # in one go, and nobody asks for any of them
            await publish(other, number)
        for number in range(21, 31):
            await seen(number - 1)
            await publish(other, number)
        await seen(30)


# A disk that damages the recording, or takes it away ----------------------------------


class Mourning(Disturbed):
    """Looks, when the run goes on, whether the recorder had ended in order."""

    finished = False

    def note(self, restart: Restart) -> None:
        super().note(restart)
        self.finished = Recording.open(f"{self._log}.broken").cut is None


def test_a_recorder_without_a_hub_writes_down_what_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(launch, "_LAST_WRITE", PATIENCE)
    mourning = Mourning(options_for(ENDLESS), tmp_path / "log")
    mourning.run((20, ("hub",)))
    assert mourning.finished


def chunks(log: Path) -> int:
    """Return how many whole chunks of a recording are on the disk."""
    try:
        return len(Recording.open(log).files[0].layout.chunks)
    except RecordingError:
        return 0


def test_a_damaged_recording_is_kept_and_told_of(tmp_path: Path) -> None:
    log, kept = tmp_path / "a.mcap", tmp_path / "a.damaged-1.mcap"
    with running(log, "--format", "json") as run:
        run.feed_until(lambda: chunks(log) >= 3)
        place = Recording.open(log).files[0].layout.chunks[0].offset + 20
        with log.open("r+b") as file:
            file.seek(place)
            (byte,) = file.read(1)
            file.seek(place)
            file.write(bytes([byte ^ 1]))
        run.kill("cell/1")
        # Lines go to the next life, too, once it has come up.
        run.feed_until(lambda: kept.exists() or (tmp_path / "a.mcap.broken").exists())
        run.feed_until(lambda: chunks(log) >= 2)
        said, errors = run.told()
    assert run.process.returncode == 3, errors
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
    with running(log, "--format", "json") as run:
        run.feed_until(lambda: chunks(log) >= 2)
        log.unlink()
        said, errors = run.told()
    assert run.process.returncode == 3, errors
    assert said["complete"] is False
    assert "must stay where and as it is while it is written" in errors
    observed = list(Recording.open(log).messages(("observation",)))
    assert len(observed) == said["ticks"]
