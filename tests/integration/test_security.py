"""A swarm under mutual TLS: its parts work as ever, intruders get nowhere, both show.

The hub is a process of its own, as in a run, and traces its decisions: whatever it
refuses is in what it said on its standard error.
"""

import asyncio
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar, cast

import msgspec
import pytest
import zenoh
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key
from typer.testing import CliRunner

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.cli import app
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.protocol import Handler, PresenceHandler
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.security.make_keys import make_keys
from neurosnap.fabric.security.roles import RIGHTS, Role, role_of
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.fabric.zenoh.session import configuration
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.replay.playback import play_on
from neurosnap.recording.write.recorder import run_recorder
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts import coordinator_process
from neurosnap.runtime.parts.cell_process import run_cell
from neurosnap.runtime.parts.coordinator_loop import run_coordinator
from neurosnap.runtime.parts.participant import take_part
from neurosnap.runtime.parts.world_process import run_world
from neurosnap.runtime.run import describe
from neurosnap.sources.open import open_source
from tests.support.patience import PATIENCE
from tests.support.ports import free_port

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

INTRUSION = 1.0  # seconds an intruder goes on trying
TICKS = 12
SWARM = "one"

BE_HUB = """
import sys
from pathlib import Path
from neurosnap.fabric.security.load_keys import read_credentials
from neurosnap.fabric.zenoh.hub import open_hub
from neurosnap.fabric.zenoh.denied_log import telling_refusals
with telling_refusals(audit=True):
    credentials = read_credentials(Path(sys.argv[2]), "hub")
    session = open_hub([sys.argv[1]], 30, credentials=credentials)
    print("ready", flush=True)
    sys.stdin.read()
    session.close()
"""


class Hub:
    """A hub under TLS, and once it has ended, what it refused."""

    def __init__(self, endpoint: str, keys: Path) -> None:
        self.endpoint = endpoint
        self.keys = keys
        self.refused: list[str] = []

    def end(self, who: str, role: Role | None = None) -> ZenohFabric:
        """Return an end with the certificate of `role`, by default the right one."""
        own = who if role is None else role
        return self.end_with(who, Credentials.in_folder(self.keys, own))

    def end_with(self, who: str, credentials: Credentials) -> ZenohFabric:
        return Noted(
            who, SWARM, self.endpoint, patience=INTRUSION, credentials=credentials
        )


@contextmanager
def hub_with(keys: Path) -> Iterator[Hub]:
    hub = Hub(f"tls/127.0.0.1:{free_port()}", keys)
    command = [sys.executable, "-c", BE_HUB, hub.endpoint, str(keys)]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        try:
            yield hub
        finally:
            _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    hub.refused = errors.splitlines()


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("security") / "keys"
    make_keys(folder)
    return folder


class Noted(ZenohFabric):
    """Notes what its part does, by role."""

    published: ClassVar[defaultdict[str, set[str]]] = defaultdict(set)
    read: ClassVar[defaultdict[str, set[str]]] = defaultdict(set)
    announced: ClassVar[defaultdict[str, set[str]]] = defaultdict(set)
    watched: ClassVar[set[str]] = set()

    @classmethod
    def forget(cls) -> None:
        for noted in (cls.published, cls.read, cls.announced):
            noted.clear()
        cls.watched.clear()

    def publish(self, *messages: wire.Message) -> None:
        topics = {wire.topic(message.key) for message in messages}
        self.published[role_of(self.who)] |= topics
        super().publish(*messages)

    async def subscribe(
        self, keys: Sequence[str], handler: Handler, *, poll: float | None = None
    ) -> None:
        self.read[role_of(self.who)] |= {wire.topic(key) for key in keys}
        await super().subscribe(keys, handler, poll=poll)

    async def announce(self) -> None:
        self.announced[role_of(self.who)].add(self.who)
        await super().announce()

    async def watch(self, handler: PresenceHandler) -> None:
        self.watched.add(role_of(self.who))
        await super().watch(handler)


class Heard:
    """What came, and a wait for a certain message."""

    def __init__(self) -> None:
        self.messages: list[wire.Message] = []
        self.sequences: list[int] = []
        self._more = asyncio.Event()

    def __call__(self, burst: list[wire.Delivery]) -> None:
        self.messages += [wire.decode(each.key, each.payload) for each in burst]
        self.sequences += [each.sequence for each in burst]
        self._more.set()

    async def wait(self, message: wire.Message) -> list[wire.Message]:
        async with asyncio.timeout(PATIENCE):
            while message not in self.messages:
                await self._more.wait()
                self._more.clear()
        return self.messages


class Seen:
    """Who came and went, and a wait for a change."""

    def __init__(self) -> None:
        self.changes: list[tuple[str, bool]] = []
        self._more = asyncio.Event()

    def __call__(self, who: str, alive: bool) -> None:
        self.changes.append((who, alive))
        self._more.set()

    async def wait(self, who: str, alive: bool) -> None:
        async with asyncio.timeout(PATIENCE):
            while (who, alive) not in self.changes:
                await self._more.wait()
                self._more.clear()


# A swarm ------------------------------------------------------------------------------


async def run_swarm(hub: Hub, options: RunOptions, log: Path) -> Completeness:
    """Run all parts over `hub`, each with a session and a certificate of its own."""
    core = coordinator_process.coordinator_for(options, None)
    source = open_source(options.source, options.seed, options.arguments)
    cells = [f"cell/{number}" for number in range(len(options.sensors))]
    leave, over = asyncio.Event(), asyncio.Event()

    async def part(
        who: str, work: Callable[[ZenohFabric], Coroutine[Any, Any, object]]
    ) -> None:
        async with hub.end(who) as fabric:
            await take_part(fabric, work(fabric))

    async def record() -> Completeness:
        with SplitWriter(log, {**describe(options), "swarm": SWARM}) as writer:
            async with hub.end("recorder") as fabric:
                parts = ("coordinator", "world", *cells)
                return await run_recorder(writer, fabric, leave, parts=parts)

    async with asyncio.TaskGroup() as group:
        recording = group.create_task(record(), name="recorder")
        for number, who in enumerate(cells):
            group.create_task(
                part(who, lambda f, number=number: run_cell(number, f, leave)),  # type: ignore[misc]
                name=who,
            )
        group.create_task(
            part("world", lambda f: run_world(source, options.body, f, leave)),
            name="world",
        )
        await part(
            "coordinator",
            lambda f: run_coordinator(
                core,
                f,
                over,
                parts=("recorder", "world", *cells),
                deadline=options.deadline,
            ),
        )
        leave.set()
    source.close()
    return await recording


def options() -> RunOptions:
    source = open_source("neurosnap/Path-v0", 2)
    source.close()
    return RunOptions(
        source="neurosnap/Path-v0",
        body=Body(own=source.sensors, actions=source.actions),
        ticks=TICKS,
        seed=2,
        threshold=0.1,
        keyframe_every=5,
    )


# What the table allows and this run need not do: nothing goes wrong, no sensor looks
# back at a state, none is read outside, and no cells share a worker.
UNSAID = {
    "coordinator": {"fault", "loom", "anomaly"},
    **{role: {"fault"} for role in ("world", "cell", "recorder")},
}
UNHEARD = {"coordinator": {"tally"}, "world": {"state", "reading"}}


async def test_a_swarm_runs_and_does_what_the_table_says(
    keys: Path, tmp_path: Path
) -> None:
    Noted.forget()
    with hub_with(keys) as hub:
        balance = await run_swarm(hub, options(), tmp_path / "log.mcap")
    assert balance.whole, balance
    assert hub.refused == []
    recording = Recording.open(tmp_path / "log.mcap")
    states = [m for m in recording.messages() if isinstance(m.message, wire.State)]
    assert len(states) == TICKS
    parts: tuple[Role, ...] = ("coordinator", "world", "recorder", "cell")
    for role in parts:
        rights = RIGHTS[role]
        may = set(rights.publishes)
        assert may - UNSAID.get(role, set()) <= Noted.published[role] <= may
        may = {"**"} if role == "recorder" else set(rights.reads)
        assert may - UNHEARD.get(role, set()) <= Noted.read[role] <= may
        assert (role in Noted.watched) == rights.watches
        assert bool(Noted.announced[role]) == rights.announces


# Intruders ----------------------------------------------------------------------------


def issue(
    keys: Path, folder: Path, role: str, since: datetime, until: datetime
) -> Credentials:
    """Sign another certificate with the authority's own key."""
    authority = x509.load_pem_x509_certificate((keys / "ca.pem").read_bytes())
    signer = load_pem_private_key((keys / "ca.key").read_bytes(), None)
    assert isinstance(signer, ec.EllipticCurvePrivateKey)
    good = x509.load_pem_x509_certificate((keys / f"{role}.pem").read_bytes())
    builder = (
        x509.CertificateBuilder()
        .subject_name(good.subject)
        .issuer_name(authority.subject)
        .public_key(good.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(since)
        .not_valid_after(until)
    )
    for extension in good.extensions:
        builder = builder.add_extension(extension.value, extension.critical)
    path = folder / f"{role}.pem"
    path.write_bytes(builder.sign(signer, SHA256()).public_bytes(Encoding.PEM))
    own = Credentials.in_folder(keys, cast("Role", role))
    return msgspec.structs.replace(own, certificate=str(path))


async def refuses(hub: Hub, credentials: Credentials) -> None:
    with pytest.raises(FabricError, match=r"^cell/0: must reach the hub at tls/"):
        async with hub.end_with("cell/0", credentials):
            pass


def test_who_has_no_certificate_is_refused_and_logged(keys: Path) -> None:
    with hub_with(keys) as hub:
        config = configuration(
            "client",
            connect__endpoints=[hub.endpoint],
            connect__timeout_ms=int(1000 * INTRUSION),
            transport__link__tls={"root_ca_certificate": str(keys / "ca.pem")},
        )
        with pytest.raises(zenoh.ZError):
            zenoh.open(config)
    assert hub.refused[0] == "session refused: peer sent no certificates."


def test_who_does_not_speak_tls_is_refused_and_logged(keys: Path) -> None:
    with hub_with(keys) as hub:
        config = configuration(
            "client",
            connect__endpoints=[hub.endpoint.replace("tls/", "tcp/")],
            connect__timeout_ms=int(1000 * INTRUSION),
        )
        with pytest.raises(zenoh.ZError):
            zenoh.open(config)
    assert hub.refused[0].startswith("session refused: ")


async def test_a_certificate_of_another_authority_is_refused_and_logged(
    keys: Path, tmp_path: Path
) -> None:
    make_keys(tmp_path / "other")
    other = Credentials.in_folder(tmp_path / "other", "cell")
    believing = msgspec.structs.replace(other, authority=str(keys / "ca.pem"))
    with hub_with(keys) as hub:
        await refuses(hub, believing)
    assert hub.refused[0].startswith("session refused: invalid peer certificate: ")


async def test_an_expired_certificate_is_refused_and_logged(
    keys: Path, tmp_path: Path
) -> None:
    now = datetime.now(UTC)
    old = issue(
        keys, tmp_path, "cell", now - timedelta(days=3), now - timedelta(days=1)
    )
    with hub_with(keys) as hub:
        await refuses(hub, old)
    reason = "session refused: invalid peer certificate: certificate expired"
    assert hub.refused[0].startswith(reason)


def test_an_expired_certificate_is_noticed_before_it_is_shown(
    keys: Path, tmp_path: Path
) -> None:
    now = datetime.now(UTC)
    issue(keys, tmp_path, "cell", now - timedelta(days=3), now - timedelta(days=1))
    for name in ("ca.pem", "cell.key"):
        (tmp_path / name).write_bytes((keys / name).read_bytes())
    (tmp_path / "cell.key").chmod(0o600)
    with pytest.raises(InvalidValueError, match=r"/cell\.pem: must be valid now, "):
        read_credentials(tmp_path, "cell")


async def test_a_part_believes_no_hub_of_another_authority(
    keys: Path, tmp_path: Path
) -> None:
    make_keys(tmp_path / "other")
    with hub_with(tmp_path / "other") as hub:
        await refuses(hub, Credentials.in_folder(keys, "cell"))


async def test_a_link_ends_with_its_certificate(keys: Path, tmp_path: Path) -> None:
    now, seen = datetime.now(UTC), Seen()
    soon = issue(
        keys, tmp_path, "cell", now - timedelta(days=1), now + timedelta(seconds=3)
    )
    with hub_with(keys) as hub:
        async with hub.end("watcher") as eyes, hub.end_with("cell/0", soon) as cell:
            await eyes.watch(seen)
            await cell.announce()
            await seen.wait("cell/0", True)
            await seen.wait("cell/0", False)
    assert hub.refused[0].startswith("session refused: Closing TLS link ")
    assert hub.refused[0].endswith("remote certificate chain expired")


WIRING = wire.Wiring(cell=1, epoch=1, after=0, add=(4,))
FORBIDDEN: tuple[wire.Message, ...] = (
    WIRING,
    wire.Decision(1, 0, "mine"),
    wire.WaveStart(1, 1, "state", 0, 1),
    wire.Observation(1, b"\x01"),
    wire.State(1, 1, b"", False, 0, 0, 0, 0, 0),
    wire.KeyFrame(1, b""),
)
PULSE = wire.Pulse(wave=1, source=0, target=2, hops=1, credit=1)


async def test_a_cell_cannot_rewire_or_conduct_others(keys: Path) -> None:
    everything, neighbour, world = Heard(), Heard(), Heard()
    seen = Seen()
    with hub_with(keys) as hub:
        async with (
            hub.end("recorder") as ears,
            hub.end("cell/1") as cell,
            hub.end("world") as place,
            hub.end("cell/0") as intruder,
        ):
            await ears.subscribe(("**",), everything)
            await cell.subscribe(wire.cell_keys(1), neighbour)
            await place.subscribe(("state", "decide"), world)
            await ears.watch(seen)
            for end in (cell, place, intruder):
                await end.announce()
                await seen.wait(end.who, True)
            # In order on one session: once its pulse is there, the rest would be too.
            intruder.publish(*FORBIDDEN, PULSE)
            assert await everything.wait(PULSE) == [PULSE]
            # What was dropped shows as a gap, audited or not.
            assert everything.sequences == [len(FORBIDDEN)]
            assert await neighbour.wait(PULSE) == [PULSE]
            assert world.messages == []
            # The same wiring from whom it may come.
            async with hub.end("coordinator") as coordinator:
                coordinator.publish(WIRING)
                await neighbour.wait(WIRING)
    tried = {line for line in hub.refused if line.startswith("cell refused: Put on ")}
    assert tried == {
        f"cell refused: Put on neurosnap/{SWARM}/{message.key}" for message in FORBIDDEN
    }
    assert len(hub.refused) == len(FORBIDDEN)  # each was told once, and nothing else


async def test_a_cell_can_neither_listen_to_others_nor_pass_for_them(
    keys: Path,
) -> None:
    overheard, everything, seen, spied = Heard(), Heard(), Seen(), Seen()
    with hub_with(keys) as hub:
        async with (
            hub.end("recorder") as ears,
            hub.end("world") as world,
            hub.end("coordinator", "cell") as intruder,
            # What a session says it hears itself: to spy takes another one.
            hub.end("cell/0") as spy,
        ):
            await ears.subscribe(("**",), everything)
            await ears.watch(seen)
            await spy.subscribe(("**",), overheard)
            await spy.subscribe(("settle/**", "decide"), overheard)
            await spy.watch(spied)
            await intruder.announce()
            await world.announce()
            await seen.wait("world", True)
            world.publish(wire.Leave("world"))
            await everything.wait(wire.Leave("world"))
    assert seen.changes.count(("coordinator", True)) == 0
    assert overheard.messages == []
    assert spied.changes == []
    prefix = f"neurosnap/{SWARM}"
    assert set(hub.refused) >= {
        f"cell refused: Declare Subscriber on {prefix}/**",
        f"cell refused: Declare Subscriber on {prefix}/settle/**",
        f"cell refused: Declare Subscriber on {prefix}/decide",
        f"cell refused: Liveliness Token on {prefix}/alive/coordinator",
        f"cell refused: Declare Liveliness Subscriber on {prefix}/alive/**",
    }


@pytest.mark.parametrize("mode", ["peer", "router"])
async def test_a_cell_gains_nothing_as_a_peer_or_a_router(
    keys: Path, mode: str
) -> None:
    everything, seen = Heard(), Seen()
    intruder = Credentials.in_folder(keys, "cell")
    with hub_with(keys) as hub:
        config = configuration(
            mode,
            connect__endpoints=[hub.endpoint],
            transport__link__tls=intruder.to_connect(),
        )
        async with hub.end("recorder") as ears, hub.end("cell/0") as cell:
            await ears.subscribe(("**",), everything)
            await ears.watch(seen)
            session = await asyncio.to_thread(zenoh.open, config)
            token = session.liveliness().declare_token(
                f"neurosnap/{SWARM}/alive/coordinator"
            )
            session.put(f"neurosnap/{SWARM}/{WIRING.key}", wire.encode(WIRING))
            await asyncio.to_thread(token.undeclare)
            await asyncio.to_thread(session.close)
            await cell.announce()
            await seen.wait("cell/0", True)
            cell.publish(PULSE)
            assert await everything.wait(PULSE) == [PULSE]
    assert ("coordinator", True) not in seen.changes


async def test_a_watcher_sees_all_and_says_nothing(keys: Path) -> None:
    heard, others = Heard(), Heard()
    last = wire.Leave("cell/0")
    with hub_with(keys) as hub:
        async with (
            hub.end("watcher") as watcher,
            hub.end("watcher") as sly,
            hub.end("recorder") as recorder,
            hub.end("cell/0") as cell,
        ):
            seen, also_seen = Seen(), Seen()
            await watcher.subscribe(("**",), heard)
            await recorder.subscribe(("**",), others)
            await watcher.watch(seen)
            await recorder.watch(also_seen)  # asked for behind its subscription
            await cell.announce()
            await seen.wait("cell/0", True)
            await also_seen.wait("cell/0", True)
            sly.publish(wire.Leave("cell/0"), wire.Fault("watcher", ""))
            cell.publish(PULSE, last)
            assert await heard.wait(last) == [PULSE, last]
            assert await others.wait(last) == [PULSE, last]
    assert set(hub.refused) == {
        f"watcher refused: Put on neurosnap/{SWARM}/leave/cell/0",
        f"watcher refused: Put on neurosnap/{SWARM}/fault/watcher",
    }


# Playing back, and the command line ---------------------------------------------------


async def test_a_recording_plays_to_who_has_a_certificate(
    keys: Path, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    with hub_with(keys) as hub:
        await run_swarm(hub, options(), log)
    recording = Recording.open(log)
    heard, seen, stop = Heard(), Seen(), asyncio.Event()
    connected = asyncio.Event()

    async def step(tick: int) -> bool:
        await connected.wait()
        return True

    endpoint = hub.endpoint.replace("127.0.0.1", "0.0.0.0")
    credentials = read_credentials(keys, "hub")
    async with asyncio.TaskGroup() as group:
        playing = group.create_task(
            play_on(recording, endpoint, stop, step=step, credentials=credentials)
        )
        async with (
            ZenohFabric(
                "watcher",
                recording.swarm,
                hub.endpoint,
                patience=PATIENCE,
                credentials=read_credentials(keys, "watcher"),
            ) as watcher,
            ZenohFabric(
                "cell/0",
                recording.swarm,
                hub.endpoint,
                patience=PATIENCE,
                credentials=read_credentials(keys, "cell"),
            ) as herald,
        ):
            await watcher.subscribe(("**",), heard)
            await watcher.watch(seen)
            await herald.announce()
            await seen.wait("cell/0", True)
            connected.set()
            played = await playing
            last = list(recording.messages())[-1].message
            await heard.wait(last)
    assert played.ticks == TICKS
    observed = [m for m in heard.messages if isinstance(m, wire.Observation)]
    assert [each.tick for each in observed] == list(range(1, TICKS + 1))


async def test_a_recording_is_not_played_to_the_network_in_the_clear(
    tmp_path: Path,
) -> None:
    with Writer(tmp_path / "log.mcap") as writer:
        writer.start({"swarm": SWARM})
        writer.finish({}, {})
    recording = Recording.open(tmp_path / "log.mcap")
    with pytest.raises(InvalidValueError, match=r"^endpoint: must be tcp/ on loopback"):
        await play_on(recording, "tcp/0.0.0.0:0", asyncio.Event())


def test_the_command_makes_keys(tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    command = ["keys", str(folder), "--host", "hub.example", "--days", "2", "--json"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    facts = msgspec.json.decode(done.stdout.splitlines()[-1])
    assert facts["folder"] == str(folder)
    assert facts["hosts"][-1] == "hub.example"
    until = datetime.fromisoformat(facts["until"])
    assert timedelta(days=1) < until - datetime.now(UTC) <= timedelta(days=2)
    assert read_credentials(folder, "hub").name == "hub"
    again = CliRunner().invoke(app, command)
    assert again.exit_code == 2
    assert "keys: must not exist yet" in again.stderr
    wrong = CliRunner().invoke(app, ["keys", str(tmp_path / "b"), "--days", "0"])
    assert wrong.exit_code == 2
