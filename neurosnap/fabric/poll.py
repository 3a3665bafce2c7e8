"""Reading at leisure: what came waits in Zenoh's own channel, not with us.

That costs neither a thread nor the GIL. A full channel holds back the hub, and so the
senders: a slow reader slows the run down and loses nothing.
"""

import asyncio
import struct

import zenoh

from neurosnap import wire
from neurosnap.fabric.protocol import Failure, Handler

BESIDE = struct.Struct("<QQ")
"""What travels beside every payload: running number, sender's clock in ns."""

_CHUNK = 4096  # deliveries handled before other tasks get their turn


class Poll:
    """Empties a channel every so often, for readers that need rate and not latency.

    Args:
        channel: Where the samples wait.
        cut: Characters of their keys that are the swarm's prefix.
        handler: Gets them, as in `Fabric.subscribe`.
        every: Seconds between two looks.
        failure: Gets what the handler raises.
    """

    def __init__(
        self,
        channel: zenoh.Handler[zenoh.Sample],
        cut: int,
        handler: Handler,
        every: float,
        failure: Failure,
    ) -> None:
        self._channel = channel
        self._cut = cut
        self._handler = handler
        self._every = every
        self._failure = failure
        self._loop = asyncio.get_running_loop()
        self._timer = self._loop.call_later(every, self._turn)

    def _turn(self) -> None:
        try:
            more = self._drain()
        except BaseException as error:  # noqa: BLE001 - goes on to `serve`, whole
            self._failure.set(error)
            return
        self._timer = self._loop.call_later(0.0 if more else self._every, self._turn)

    def _drain(self) -> bool:
        """Hand over up to a chunk of deliveries; tell whether more may wait."""
        samples: list[zenoh.Sample] = []
        while len(samples) < _CHUNK:
            try:
                sample = self._channel.try_recv()
            except zenoh.ZError:  # empty, and closed for good
                break
            if sample is None:
                break
            samples.append(sample)
        found = (delivered(sample, self._cut) for sample in samples)
        burst = [delivery for delivery in found if delivery is not None]
        if burst:
            self._handler(burst)
        return len(samples) == _CHUNK

    def finish(self) -> None:
        """Hand over the rest, unless the part has failed.

        Called once nothing more can arrive.
        """
        self._timer.cancel()
        while not self._failure.happened and self._drain():
            pass


def delivered(sample: zenoh.Sample, cut: int) -> wire.Delivery | None:
    """Copy a sample out of Zenoh's hands; None for a stranger's."""
    beside = sample.attachment
    if beside is None:
        return None
    raw = beside.to_bytes()
    if len(raw) != BESIDE.size:
        return None
    number, sent = BESIDE.unpack(raw)
    return wire.Delivery(
        str(sample.key_expr)[cut:], number, sent, sample.payload.to_bytes()
    )
