"""The learned order at every tick, derived again from the observations."""

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.observations import readings
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.keyframes import last_start
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.read.ticks import Tick


class Learning:
    """Learns from one tick after the other.

    Args:
        recording: A run's, or a later part of it, which begins with a key-frame.
        options: The run's.

    Raises:
        RecordingError: The key-frame is missing.
    """

    def __init__(self, recording: Recording, options: RunOptions) -> None:
        self._count = len(options.sensors)
        self.tick = recording.begins
        """The last tick learned from."""
        self._snapshot = options.new_snapshot()
        self._frames: dict[int, bytes] = {}  # of key-frames not passed yet
        if self.tick:
            start = last_start(recording, self.tick)
            if start is None or start.frame.tick != self.tick:
                rule = f"must begin with the key-frame of tick {self.tick}"
                raise RecordingError(f"{recording.path}: {rule}, got none")
            self._snapshot = Snapshot.from_bytes(start.frame.snapshot)

    @property
    def graph(self) -> PocGraph:
        """The order learned so far."""
        return self._snapshot.poc_graph()

    def offer(self, frame: wire.KeyFrame) -> None:
        """Take note of a key-frame: behind a gap it is learned on from there."""
        if frame.tick > self.tick:
            self._frames[frame.tick] = frame.snapshot

    def take(self, tick: Tick) -> bool:
        """Learn from a tick, if it follows; return whether it does.

        Raises:
            ShapeError: It is not of such sensors.
            ValueError: A key-frame holds no snapshot.
        """
        before = tick.number - 1
        if before > self.tick and before in self._frames:
            self._snapshot = Snapshot.from_bytes(self._frames[before])
            self.tick = before
        self._frames = {k: v for k, v in self._frames.items() if k > before}
        if tick.number != self.tick + 1 or tick.observation is None:
            return False
        self._snapshot.learn(*readings(tick.observation, self._count))
        self.tick = tick.number
        return True
