"""Readings and decisions exchanged with outside programs that use plain Zenoh."""

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest
import zenoh

from neurosnap import wire
from neurosnap.fabric.hub_address import Credentials, HubAddress
from neurosnap.fabric.roles import Role
from neurosnap.fabric.zenoh.connect_session import connecting
from neurosnap.fabric.zenoh.discovery import incarnation
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.parts.job import PartConnection
from neurosnap.sensorium import pack
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.tick_schedule import OnChange
from neurosnap.sources.live.zenoh_source import ZenohFeeder
from tests.support.commands import Command
from tests.support.fabrics import hub_in_process
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.secured_hub import hub_with
from tests.support.senders import listened_to
from tests.support.sources import readings

pytestmark = pytest.mark.slow
SWARM = "home"
NAMES = ("door", "motion")
EXAMPLE = Path(__file__).parents[2] / "examples" / "any_program.py"


@pytest.fixture(scope="module")
def hub() -> Iterator[str]:
    """A hub on loopback, for one swarm after the other."""
    with hub_in_process(f"tcp/127.0.0.1:{free_port()}") as one:
        yield one.endpoint


def session(
    endpoint: str, role: Role = "sensor", keys: Path | None = None
) -> zenoh.Session:
    """Open a session as any program would: there is nothing of ours in it."""
    own = None if keys is None else Credentials.in_folder(keys, role)
    return zenoh.open(connecting(HubAddress(endpoint, own), PATIENCE))


class Ticks(threading.Thread):
    """Takes ticks until the source is over, and lets others wait for one."""

    def __init__(self, source: LiveSource) -> None:
        super().__init__()
        self.source = source
        self._more = threading.Condition()
        self._ticks: list[list[bool | None]] = []

    def run(self) -> None:
        seen = self.source.first()
        while seen is not None:
            tick = readings(seen)
            with self._more:
                self._ticks.append(tick)
                self._more.notify_all()
            seen = self.source.step(-1)

    def wait(self, tick: list[bool | None]) -> list[list[bool | None]]:
        with self._more:
            assert self._more.wait_for(lambda: tick in self._ticks, PATIENCE), (
                self._ticks
            )
            return list(self._ticks)


@contextmanager
def ticking(hub: str, swarm: str = SWARM) -> Iterator[Ticks]:
    feeder = ZenohFeeder(PartConnection("world", swarm, HubAddress(hub)))
    source = LiveSource(LatestReadings(NAMES), OnChange(), feeder=feeder)
    ticks = Ticks(source)
    ticks.start()
    try:
        with session(hub) as sensor:
            listened_to(sensor, f"neurosnap/{SWARM}/reading").undeclare()
        yield ticks
    finally:
        source.close()
        ticks.join(PATIENCE)
    assert not ticks.is_alive()


@pytest.mark.zenoh
def test_after_a_restart_a_program_is_heard_under_the_id_that_it_knows(
    hub: str,
) -> None:
    again = incarnation(SWARM, 1)
    with ticking(hub, again) as ticks, session(hub) as sensor:
        sensor.put(f"neurosnap/{SWARM}/reading", b'{"bits": [1, 0]}')
        ticks.wait([True, False])
        sensor.put("neurosnap/other/reading/door", "off")  # of another swarm
        sensor.put(f"neurosnap/{again}/reading/motion", b"on")
        assert ticks.wait([True, True]) == [[True, False], [True, True]]


@pytest.mark.zenoh
def test_a_hub_that_goes_is_an_outage_until_it_is_back() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as ends:
        with hub_in_process(endpoint):
            ticks = ends.enter_context(ticking(endpoint))
        while ticks.source.statistics().received.outages < 1:
            time.sleep(0)
        ends.enter_context(hub_in_process(endpoint))
        sensor = ends.enter_context(session(endpoint))
        door = listened_to(sensor, f"neurosnap/{SWARM}/reading")
        door.put(b'{"bits": [1, 0]}')
        ticks.wait([True, False])
        assert ticks.source.statistics().received.outages == 1


@pytest.mark.zenoh
def test_the_example_publishes_what_a_source_then_shows(hub: str) -> None:
    with ticking(hub) as ticks:
        assert called(hub, SWARM, "door=on", "motion=off").returncode == 0
        ticks.wait([True, False])


@pytest.mark.parametrize("given", [(), ("tcp/h:1",), ("tcp/h:1", "home", "door")])
def test_the_example_says_how_it_is_called(given: tuple[str, ...]) -> None:
    told = called(*given)
    assert (told.returncode, told.stdout) == (1, "")
    assert told.stderr.startswith("usage: python any_program.py ENDPOINT SWARM [")


@pytest.mark.zenoh
def test_the_example_says_what_to_do_without_a_hub() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    told = called(endpoint, "home", "door=on")
    assert (told.returncode, told.stdout) == (1, "")
    start = f"neurosnap run ... --swarm home --listen {endpoint} (Unable to connect"
    assert told.stderr.startswith(f"no swarm listens on {endpoint}; start one")
    assert start in told.stderr
    assert told.stderr.count("\n") == 1


def called(*given: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(EXAMPLE), *given]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, check=False
    )


@pytest.mark.zenoh
def test_the_example_shows_what_a_swarm_decides(hub: str) -> None:
    with session(hub) as coordinator:
        command = [sys.executable, str(EXAMPLE), hub, SWARM]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
            assert program.stdout is not None
            try:
                decides = listened_to(coordinator, f"neurosnap/{SWARM}/decision")
                decides.put(wire.encode(wire.Decision(1, -1, "why not")))
                said = program.stdout.readline()
            finally:
                program.kill()
    assert json.loads(said)["action"] == -1


@pytest.mark.zenoh
def test_under_tls_the_role_sensor_can_say_and_hear_nothing_else(
    role_keys: Path,
) -> None:
    with (
        hub_with(role_keys) as secured,
        session(secured.endpoint, "watcher", role_keys) as eyes,
        session(secured.endpoint, "sensor", role_keys) as sensor,
        session(secured.endpoint, "cell", role_keys) as cell,
        session(secured.endpoint, "world", role_keys) as world,
    ):
        came = {"observation": threading.Event(), "reading/last": threading.Event()}

        def note(said: list[str], sample: zenoh.Sample) -> None:
            said.append(str(sample.key_expr).removeprefix(f"neurosnap/{SWARM}/"))
            if said is heard and said[-1] in came:
                came[said[-1]].set()

        heard: list[str] = []
        overheard: list[str] = []
        watching, listening = (
            listener.declare_subscriber(
                f"neurosnap/{SWARM}/**",
                zenoh.handlers.Callback(partial(note, said), indirect=False),
            )
            for listener, said in ((eyes, heard), (sensor, overheard))
        )
        # Once the hub knows that the watcher listens, it passes on what it may.
        while not came["observation"].wait(0.05):
            world.put(f"neurosnap/{SWARM}/observation", "on")
        for topic in wire.TOPICS:
            sensor.put(f"neurosnap/{SWARM}/{topic}", "on")
        cell.put(f"neurosnap/{SWARM}/reading/door", "on")
        sensor.put(f"neurosnap/{SWARM}/reading/last", "on")
        assert came["reading/last"].wait(PATIENCE)
        listening.undeclare()
        watching.undeclare()
    assert {*heard} == {"observation", "reading/last"}
    # A session hears itself without the hub; what others said did not come.
    assert overheard == [*wire.TOPICS, "reading/last"]


@pytest.mark.zenoh
def test_a_program_puts_readings_and_reads_what_the_swarm_makes_of_them(
    role_keys: Path, tmp_path: Path
) -> None:
    log = tmp_path / "outside.mcap"
    readings = [(number % 2, int(number % 3 > 0)) for number in range(30)]
    endpoint = f"tls/127.0.0.1:{free_port()}"
    given = ["zenoh:", "--set", f"sensors={','.join(NAMES)}", "--swarm", SWARM]
    given += ["--listen", endpoint, "--tls", str(role_keys), "--out", str(log)]
    states = []
    with Command("run", *given, "--threshold", "0.1") as process:
        # Wait for each state before putting the next reading.
        with (
            session(endpoint, "watcher", role_keys) as eyes,
            session(endpoint, "sensor", role_keys) as mouth,
        ):
            said = eyes.declare_subscriber(f"neurosnap/{SWARM}/state")
            publisher = listened_to(mouth, f"neurosnap/{SWARM}/reading")
            for bits in readings:
                publisher.put(json.dumps({"bits": bits}))
                sample = said.recv()
                states.append(wire.decode("state", sample.payload.to_bytes()))
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(PATIENCE)
    assert process.returncode == 0, errors
    recording = Recording.open(log)
    # Readings pass by the recorder: no message of ours, and no attack.
    balance = recording.balance(recording.sequences())
    assert (balance.whole, balance.foreign) == (True, 0)
    observed = [r.message for r in recording.messages(("observation",))]
    assert [m.bits for m in observed if isinstance(m, wire.Observation)] == [
        pack([bool(bit) for bit in bits]) for bits in readings
    ]
    assert [r.message for r in recording.messages(("state",))] == states
