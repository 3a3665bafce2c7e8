"""The learned order at every tick, derived again from the observations."""

from neurosnap.errors import RecordingError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.keyframes import Start, last_start
from neurosnap.recording.read.learning import Learning
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.ticks import Tick


class LearnedOrders:
    """Learns from one tick after the other.

    Args:
        recording: A run's, or a later part of it, which begins with a key-frame.
        options: The run's.

    Raises:
        RecordingError: The key-frame is missing, or not of this run.
    """

    def __init__(self, recording: Recording, options: RunOptions) -> None:
        self._learning = Learning(recording.path, options)
        self._frames: dict[int, Start] = {}  # those not passed yet
        if begins := recording.begins:
            start = last_start(recording, begins)
            if start is None or start.frame.tick != begins:
                rule = f"must begin with the key-frame of tick {begins}"
                raise RecordingError(f"{recording.path}: {rule}, got none")
            self._learning.restore(start.frame, start.bands)

    @property
    def tick(self) -> int:
        """The last tick learned from."""
        return self._learning.tick

    @property
    def graph(self) -> PocGraph:
        """The order learned so far."""
        return self._learning.snapshot.poc_graph()

    def offer(self, start: Start) -> None:
        """Take note of a key-frame: behind a gap it is learned on from there."""
        if start.frame.tick > self.tick:
            self._frames[start.frame.tick] = start

    def take(self, tick: Tick) -> bool:
        """Learn from a tick, if it follows; return whether it does.

        Raises:
            RecordingError: It or a key-frame is not of the run's sensors.
        """
        before = tick.number - 1
        if before > self.tick and before in self._frames:
            start = self._frames[before]
            self._learning.restore(start.frame, start.bands)
        self._frames = {k: v for k, v in self._frames.items() if k > before}
        if tick.number != self.tick + 1 or tick.observation is None:
            return False
        self._learning.learn(tick.observation, tick.decision)
        return True
