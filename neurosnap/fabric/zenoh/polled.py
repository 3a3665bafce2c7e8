"""A polled subscription: messages wait in Zenoh's channel until read.

That costs neither a thread nor the GIL. A full channel holds back the hub, and so the
senders: a slow reader slows the run down and loses nothing.
"""

import asyncio
from collections.abc import Callable

import zenoh

from neurosnap import wire
from neurosnap.fabric.protocol import Failure, Handler

_CHUNK = 4096  # deliveries handled before other tasks get their turn


class Poll:
    """Empties a channel every so often, for readers that need rate and not latency.

    Args:
        channel: Where the samples wait.
        take: Makes a delivery of a sample, or of the last of several.
        handler: Gets them, as in `Fabric.subscribe`.
        every: Seconds between two looks.
        failure: Gets what the handler raises.
    """

    def __init__(
        self,
        channel: zenoh.Handler[zenoh.Sample],
        take: Callable[[zenoh.Sample], wire.Delivery | None],
        handler: Handler,
        every: float,
        failure: Failure,
    ) -> None:
        self._channel = channel
        self._take = take
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
        found = map(self._take, samples)
        batch = [delivery for delivery in found if delivery is not None]
        if batch:
            self._handler(batch)
        return len(samples) == _CHUNK

    def finish(self) -> None:
        """Hand over the rest, unless the part has failed.

        Called once nothing more can arrive.
        """
        self._timer.cancel()
        while not self._failure.happened and self._drain():
            pass
