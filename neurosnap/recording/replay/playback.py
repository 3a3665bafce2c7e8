"""Plays a recording back over Zenoh, message by message.

A program that watches ``neurosnap/<swarm>/**`` sees the run again, at any speed.
Nothing is derived here, and nothing but the recording decides what is sent.
"""

import asyncio
import itertools
import time
from collections.abc import Awaitable, Callable, Iterator
from typing import NamedTuple

import msgspec

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.fabric.hub_address import Credentials, HubAddress, nearest
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.fabric.zenoh.hub import open_hub
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learn_again import learned_at

_NS = 1e9
_WATCHERS = 1000
_BURST = 256  # messages sent before other tasks get their turn


class Played(msgspec.Struct):
    """The result of a playback."""

    ticks: int = 0
    messages: int = 0
    seconds: float = 0.0


class Playing(NamedTuple):
    """The options of a playback."""

    rate: float = 1.0
    """How many times as fast as it was recorded."""
    start: int = 1
    """The first tick."""
    on_begin: Callable[[], Awaitable[None]] | None = None
    """Awaited once before the first message, when nothing is wrong."""
    on_progress: Callable[[int], None] = lambda _: None
    """Told each tick."""


AS_IT_WAS = Playing()


async def play_on(
    recording: Recording,
    endpoint: str,
    stop: asyncio.Event,
    playing: Playing = AS_IT_WAS,
    *,
    credentials: Credentials | None = None,
    insecure: bool = False,
) -> Played:
    """Open a hub on `endpoint` and play to all programs that connect; see `play`.

    With `credentials`, the hub's, a program that connects needs some of the same
    authority; without, the endpoint must be on this machine unless `insecure`.

    Raises:
        InvalidValueError: The endpoint breaks the rule of `check_endpoint`.
        FabricError: The endpoint is in use, or cannot be listened on.
    """
    hub = await asyncio.to_thread(
        open_hub, [endpoint], _WATCHERS, credentials=credentials, insecure=insecure
    )
    try:
        async with ZenohFabric(
            "player",
            recording.swarm,
            HubAddress(nearest(endpoint), credentials, insecure),
        ) as fabric:
            return await play(recording, fabric, stop, playing)
    finally:
        await asyncio.to_thread(hub.close)


async def play(
    recording: Recording,
    fabric: ZenohFabric,
    stop: asyncio.Event,
    playing: Playing = AS_IT_WAS,
) -> Played:
    """Publish what was recorded, from the first tick to the end or until `stop`.

    Before a start further on, the snapshot of the tick before goes out as a key-frame,
    so that it is known what had been learned.

    Args:
        recording: What to play.
        fabric: Entered by the caller, with the recorded run's swarm id.
        stop: Ends it.
        playing: How.

    Raises:
        InvalidValueError: There is no such tick to start with, or the rate is no speed.
        RecordingError: The recording is damaged.
    """
    rate, start, on_begin, on_progress = playing
    if not 0 < rate < float("inf"):
        raise InvalidValueError("rate", "must be positive and finite", rate)
    last = TickIndex(recording).last_tick()
    if not 1 <= start <= max(last, 1):
        raise InvalidValueError("from", f"must be in [1, {last}]", start)
    if on_begin is not None:
        await on_begin()
    played, began = Played(), time.perf_counter()
    if start > 1:
        snapshot = learned_at(recording, start - 1)
        fabric.publish(wire.KeyFrame(start - 1, snapshot.to_bytes()))
    first, since = None, time.perf_counter()
    for count, recorded in enumerate(_from(recording, start)):
        message = recorded.message
        if isinstance(message, wire.Observation):
            played.ticks += 1
            on_progress(message.tick)
        first = recorded.log_time if first is None else first
        due = since + (recorded.log_time - first) / _NS / rate
        delay = due - time.perf_counter()
        if delay > 0:
            await wait_any(stop, seconds=delay)
        elif count % _BURST == 0:
            await asyncio.sleep(0)
        if stop.is_set():
            break
        # A stranger's message, recorded once, has no key.
        if wire.is_part(message.sender):
            fabric.forward(recorded.delivery)
            played.messages += 1
    played.seconds = time.perf_counter() - began
    return played


def _from(recording: Recording, start: int) -> Iterator[Recorded]:
    """Yield what was recorded from the observation of tick `start` on."""

    def before(recorded: Recorded) -> bool:
        message = recorded.message
        return not (isinstance(message, wire.Observation) and message.tick >= start)

    messages = recording.messages()
    return messages if start == 1 else itertools.dropwhile(before, messages)
