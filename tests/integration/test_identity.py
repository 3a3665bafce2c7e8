"""Who speaks is who it says: what a stolen certificate tries against a run under TLS.

The intruder is let in, hears what its certificate may hear, and knows the protocol. It
strikes while the run is under way.
"""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.fabric.keys import make_keys
from neurosnap.fabric.over_zenoh import ZenohFabric
from neurosnap.record.reader import Recording
from neurosnap.record.replay import verify
from neurosnap.record.sequences import Completeness
from neurosnap.swarm.options import RunOptions
from tests.integration.test_security import SWARM, Hub, hub_with, options, run_swarm

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

TICKS = 60
STRIKE = 5  # the tick at which it strikes
FORGED = 100  # messages of each kind


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("identity") / "keys"
    make_keys(folder)
    return folder


def forged(
    message: wire.Message, key: str, count: int = FORGED
) -> Iterator[wire.Delivery]:
    """Yield a message under some key, with numbers that its sender is yet to use."""
    for number in range(count):
        yield wire.Delivery(key, 50 + number, 0, wire.encode(message))


async def struck(
    hub: Hub, attack: list[wire.Delivery], log: Path, who: str = "cell/9"
) -> tuple[RunOptions, Completeness]:
    """Run a swarm; send `attack` with the certificate of `who` in the middle of it."""
    given = msgspec.structs.replace(options(), ticks=TICKS, keyframe_every=20)
    sent = asyncio.Event()

    async with hub.end(who) as intruder:

        def strike(burst: list[wire.Delivery]) -> None:
            for delivery in burst:
                message = wire.decode(delivery.key, delivery.payload)
                assert isinstance(message, wire.Observation)
                if message.tick == STRIKE:
                    for each in attack:
                        ZenohFabric.forward(intruder, each)
                    sent.set()

        await intruder.subscribe(("observe",), strike)
        balance = await run_swarm(hub, given, log)
        assert sent.is_set()
    return given, balance


def check_untouched(log: Path) -> None:
    """The recording is of the whole run, and is what the run would have said."""
    ticks = [
        each.message.tick
        for each in Recording.open(log).messages(("state",))
        if isinstance(each.message, wire.State)
    ]
    assert ticks == list(range(1, TICKS + 1))
    verdict = verify(log)
    assert (verdict.difference, verdict.complete) == (None, True)


async def test_nobody_can_use_up_the_numbers_of_another(
    keys: Path, tmp_path: Path
) -> None:
    """The coordinator's own messages would be dropped as having come before."""
    fault = wire.Fault("coordinator", "mine")
    attack = [*forged(fault, "fault/coordinator"), *forged(fault, "fault/cell/9")]
    log = tmp_path / "log.mcap"
    with hub_with(keys) as hub:
        _, balance = await struck(hub, attack, log)
    assert balance.whole, balance
    assert balance.duplicates == 0
    # Under a key of its own it came through, and was nobody's.
    assert balance.foreign == FORGED
    assert f"cell refused: Put on neurosnap/{SWARM}/fault/coordinator" in hub.refused
    check_untouched(log)


async def test_nobody_can_say_the_last_word_of_another(
    keys: Path, tmp_path: Path
) -> None:
    """The run would end there, and be called whole."""
    log = tmp_path / "log.mcap"
    others = ("coordinator", "world", "recorder")
    attack = [
        delivery
        for who in others
        for key in (f"leave/{who}", "leave/cell/9", "leave/cell/*", "leave/**")
        for delivery in forged(wire.Leave(who), key, 1)
    ]
    with hub_with(keys) as hub:
        _, balance = await struck(hub, attack, log)
    assert balance.whole, balance
    assert set(hub.refused) >= {
        f"cell refused: Put on neurosnap/{SWARM}/leave/{who}" for who in (*others, "**")
    }
    check_untouched(log)
