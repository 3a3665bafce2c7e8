"""A recording played back over Zenoh, as a subscriber receives it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.fabric.certificates import read_credentials
from neurosnap.fabric.hub_address import Credentials, HubAddress
from neurosnap.fabric.zenoh.hub import open_hub
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.recording.replay.playback import Played, Playing, play, play_on
from neurosnap.recording.write.writer import Writer
from tests.support.fabrics import Heard, Seen
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.recorded_runs import TICKS

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture(scope="module")
def recording(path_log: Path) -> Recording:
    return Recording.open(path_log)


def deliveries(recording: Recording) -> list[wire.Delivery]:
    return [recorded.delivery for recorded in recording.messages()]


def from_tick(recording: Recording, tick: int) -> list[wire.Delivery]:
    """Return what was recorded from the observation of `tick` on."""
    recorded = list(recording.messages())
    start = next(
        place
        for place, each in enumerate(recorded)
        if isinstance(each.message, wire.Observation) and each.message.tick == tick
    )
    return [each.delivery for each in recorded[start:]]


class Ears(Heard):
    """Hears all that is said under a swarm's prefix, and not who is there."""

    def __call__(self, burst: list[wire.Delivery]) -> None:
        super().__call__([one for one in burst if not one.key.startswith("alive/")])


@asynccontextmanager
async def watching(
    swarm: str, endpoint: str, keys: Path | None = None
) -> AsyncIterator[Ears]:
    """Watch a swarm; entered once the hub is known to pass everything on.

    It watches who is there on the session of its subscription, and behind that: once
    it sees anybody, the hub has both.
    """
    heard, seen = Ears(), Seen()

    def part(who: str) -> ZenohFabric:
        own = None if keys is None else Credentials.in_folder(keys, who)
        return ZenohFabric(who, swarm, HubAddress(endpoint, own), patience=PATIENCE)

    async with part("watcher") as ears, part("cell/0") as herald:
        await ears.subscribe(("**",), heard, poll=0.01)
        await ears.watch(seen)
        await herald.announce()
        await seen.wait(("cell/0", True))
        yield heard


@asynccontextmanager
async def stage(
    recording: Recording, endpoint: str
) -> AsyncIterator[tuple[ZenohFabric, Ears]]:
    """Open a hub with a player's fabric and a watcher on it."""
    hub = await asyncio.to_thread(open_hub, [endpoint], 3)
    try:
        async with (
            watching(recording.swarm, endpoint) as heard,
            ZenohFabric("player", recording.swarm, HubAddress(endpoint)) as fabric,
        ):
            yield fabric, heard
    finally:
        await asyncio.to_thread(hub.close)


@pytest.mark.parametrize("secured", [False, True])
async def test_playing_on_an_endpoint_reaches_a_program_that_connects(
    recording: Recording, endpoint: str, role_keys: Path, secured: bool
) -> None:
    keys = role_keys if secured else None
    where = f"tls/127.0.0.1:{free_port()}" if secured else endpoint
    own = read_credentials(keys, "hub") if keys else None
    every = where.replace("127.0.0.1", "0.0.0.0")  # on each address of this machine
    expected = deliveries(recording)
    shown: list[int] = []
    connected = asyncio.Event()

    async def begin() -> None:  # the hub is up by now
        await connected.wait()

    playing = Playing(1e6, on_begin=begin, on_progress=shown.append)
    async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as group:
        played = group.create_task(
            play_on(recording, every, asyncio.Event(), playing, credentials=own)
        )
        async with watching(recording.swarm, where, keys) as heard:
            connected.set()
            await heard.wait(len(expected))
            # One session plays it all, so all keeps its order: keys, numbers, bytes.
            assert heard.deliveries == expected
    assert shown == list(range(1, TICKS + 1))
    assert (played.result().messages, played.result().ticks) == (len(expected), TICKS)
    assert played.result().seconds > 0


@pytest.mark.parametrize("start", [2, TICKS])
async def test_a_start_further_on_sends_what_was_learned_first(
    recording: Recording, endpoint: str, start: int
) -> None:
    expected = from_tick(recording, start)
    async with stage(recording, endpoint) as (fabric, heard):
        played = await play(
            recording, fabric, asyncio.Event(), Playing(rate=1000.0, start=start)
        )
        await heard.wait(1 + len(expected))
    assert played.ticks == TICKS - start + 1
    assert played.messages == len(expected)
    first, *rest = heard.deliveries
    _, snapshot = snapshot_at(recording, start - 1)
    frame = wire.KeyFrame(start - 1, snapshot.to_bytes())
    assert wire.decode(first.key, first.payload) == frame
    assert rest == expected


async def test_it_stops_in_the_middle_of_a_wait(
    recording: Recording, endpoint: str
) -> None:
    stop = asyncio.Event()

    def on_progress(tick: int) -> None:
        if tick == 1:
            asyncio.get_running_loop().call_soon(stop.set)

    async with asyncio.timeout(PATIENCE):
        # At this rate the second message would be due in years.
        played = await play_on(
            recording, endpoint, stop, Playing(rate=1e-12, on_progress=on_progress)
        )
    assert played.ticks == 1
    assert played.messages < len(deliveries(recording)) - len(from_tick(recording, 2))


async def test_it_keeps_the_pace_that_was_recorded(
    tmp_path: Path, endpoint: str, recording: Recording
) -> None:
    """Play ten observations that were recorded a hundredth of a second apart."""
    log, pause = tmp_path / "log", 10_000_000
    with Writer(log) as writer:
        writer.start(recording.metadata)
        for tick in range(1, 11):
            observation = wire.Observation(tick, bytes(3))
            state = wire.State(tick, tick, bytes(5), False, 0, 0, 0, 0, 0)
            for message in (observation, state):
                delivery = wire.Delivery(
                    message.key, tick - 1, tick, wire.encode(message)
                )
                writer.add(delivery, tick * pause)
        writer.finish({}, {})

    async def at(rate: float) -> Played:
        stop = asyncio.Event()
        return await play_on(Recording.open(log), endpoint, stop, Playing(rate=rate))

    as_recorded = await at(1.0)
    twice_as_slow = await at(0.5)
    assert as_recorded.messages == twice_as_slow.messages == 20
    assert as_recorded.seconds >= 9 * 0.01
    assert twice_as_slow.seconds >= 18 * 0.01


@pytest.mark.parametrize(
    ("playing", "rule"),
    [
        *(
            (Playing(rate=rate), f"rate: must be positive and finite, got {rate}")
            for rate in (0.0, -1.0, float("inf"), float("nan"))
        ),
        *(
            (Playing(start=start), rf"from: must be in \[1, {TICKS}\], got {start}")
            for start in (-3, 0, TICKS + 1)
        ),
    ],
)
async def test_what_cannot_be_played_is_refused(
    recording: Recording, endpoint: str, playing: Playing, rule: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{rule}$"):
        await play_on(recording, endpoint, asyncio.Event(), playing)
