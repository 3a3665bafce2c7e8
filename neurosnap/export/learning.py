"""The order as it was learned, tick after tick, derived again from the observations."""

from neurosnap.errors import RecordingError
from neurosnap.export.ticks import Tick
from neurosnap.poc.graph import PocGraph
from neurosnap.poc.snapshot import Snapshot
from neurosnap.record.reader import Recording
from neurosnap.record.starts import last_start
from neurosnap.swarm.options import RunOptions
from neurosnap.swarm.readings import readings


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

    def take(self, tick: Tick) -> bool:
        """Learn from a tick, if it follows; return whether it does.

        Raises:
            ShapeError: It is not of such sensors.
        """
        if tick.number != self.tick + 1 or tick.observation is None:
            return False
        self._snapshot.learn(*readings(tick.observation, self._count))
        self.tick = tick.number
        return True
