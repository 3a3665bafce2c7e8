"""The images of an environment that a recording holds, by tick."""

from neurosnap import wire
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.tick_index import TickIndex

_BACK = 8
"""Images that are looked for, at most: one may be lost, and so many not in a row."""


class RecordedImages:
    """Finds images; to be used by one thread at a time.

    Args:
        tick_index: The recording.
        options: The run's.
    """

    def __init__(self, tick_index: TickIndex, options: RunOptions) -> None:
        self._tick_index = tick_index
        self._every = options.frames
        self._last: wire.Image | None = None

    def latest(self, tick: int) -> wire.Image | None:
        """Return the last image at a tick or before; None: there is none near.

        Where none is lost, the chunks of one tick are unpacked.
        """
        if not self._every or tick < 1:
            return None
        due = tick - (tick - 1) % self._every
        for taken in range(due, max(0, due - _BACK * self._every), -self._every):
            last = self._last
            image = last if last and last.tick == taken else self._of(taken)
            if image is not None:
                self._last = image
                return image
        return None

    def _of(self, tick: int) -> wire.Image | None:
        """Return the image of a tick.

        Its sender is the world's: it is between the tick's observation and the next.
        """
        index = self._tick_index
        first, last = index.chunk_of(tick), index.chunk_after(tick)
        for _, chunk in index.readable(first, last + 1):
            for image in chunk.all("image", wire.Image):
                if image.tick == tick:
                    return image
        return None
