"""Oversized messages are rejected; large key-frames arrive."""

import os
from pathlib import Path

import psutil
import pytest
import zenoh

from neurosnap import wire
from neurosnap.errors import FabricError
from neurosnap.fabric.zenoh.connect_session import LARGEST
from tests.support.fabrics import Heard, Seen
from tests.support.secured_hub import SWARM, hub_with

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]
MIB = 1 << 20
HUGE = 320 * MIB


async def test_a_huge_message_fills_nobodys_memory(role_keys: Path) -> None:
    heard = Heard()
    key = f"neurosnap/{SWARM}/{PULSE.key}"
    with hub_with(role_keys) as hub:
        process = psutil.Process(hub.pid)
        async with hub.end("recorder") as ears, hub.end("cell/0") as cell:
            await ears.subscribe(("**",), heard)
            session = hub.session()
            try:
                cell.publish(PULSE)
                await heard.wait_for(PULSE)
                before = process.memory_info().rss
                sizes = (LARGEST + MIB, HUGE, LARGEST + MIB)
                for wave, size in enumerate(sizes, PULSE.wave + 1):
                    session.put(
                        key,
                        bytes(size),
                        congestion_control=zenoh.CongestionControl.BLOCK,
                        attachment=bytes(16),
                    )
                    # Behind it on the same link, which has to be there still.
                    after = wire.Pulse(wave=wave, source=0, target=2, hops=1, credit=1)
                    session.put(
                        key,
                        wire.encode(after),
                        congestion_control=zenoh.CongestionControl.BLOCK,
                        attachment=bytes(16),
                    )
                    await heard.wait_for(after)
                grown = process.memory_info().rss - before
            finally:
                session.close()
    assert len(heard.messages()) == 4
    assert grown < HUGE // 2


PULSE = wire.Pulse(wave=1, source=0, target=2, hops=1, credit=1)


async def test_the_largest_key_frame_arrives(role_keys: Path) -> None:
    heard, polled = Heard(), Heard()
    frame = wire.KeyFrame(1, os.urandom(wire.LARGEST_PAYLOAD * 3 // 4 - MIB))
    last = wire.Leave("coordinator")
    with hub_with(role_keys) as hub:
        async with (
            hub.end("recorder") as ears,
            hub.end("watcher") as eyes,
            hub.end("coordinator") as coordinator,
        ):
            seen = Seen()
            await ears.subscribe(("**",), polled, poll=0.01)
            await eyes.subscribe(("keyframe", "leave/**"), heard)
            await eyes.watch(seen)
            await coordinator.announce()
            await seen.wait(("coordinator", True))
            with pytest.raises(
                FabricError, match=r"^message on keyframe: must have at"
            ):
                coordinator.publish(wire.KeyFrame(1, bytes(wire.LARGEST_PAYLOAD)))
            coordinator.publish(frame, last)
            assert await heard.wait_for(last) == [frame, last]
            assert await polled.wait_for(last) == [frame, last]
    assert polled.sequences() == heard.sequences() == [0, 1]
