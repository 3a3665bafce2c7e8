"""Foxglove export: a second MCAP file with messages that Foxglove draws.

Foxglove and Lichtblick open a recording as it is. What they cannot do is to take
packed bits apart, and to derive the order that was learned. The derived messages are
not in the recording, because that holds what was on the wire and is verified by that;
and because whoever records knows no order and would have to learn it a second time.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.apps.export.foxglove_layout import (
    BELIEVED,
    GRAPH,
    LOG,
    READINGS,
    STATE,
    layout,
)
from neurosnap.apps.export.foxglove_scene import order_scene, state_scene
from neurosnap.apps.export.foxglove_schemas import UNKNOWN
from neurosnap.apps.export.foxglove_writer import COPIED, Sink
from neurosnap.apps.export.learned_orders import LearnedOrders
from neurosnap.apps.export.log_lines import line_of, lost_line, resumed_line
from neurosnap.errors import InvalidValueError, MessageError, RecordingError
from neurosnap.protocol.anomaly_messages import with_support
from neurosnap.protocol.observations import readings
from neurosnap.recording.read.births import Births, births_of
from neurosnap.recording.read.file import Recorded
from neurosnap.recording.read.keyframes import Gathering, Start
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of, resumed_at
from neurosnap.recording.read.ticks import InOrder, Tick
from neurosnap.sensorium import Sensorium, selection, unpack

LAYOUT = "layout.json"
"""What the layout is attached as."""

_EVERY = 10**8
"""Nanoseconds between two scenes; more of them nobody could see."""


def layout_of(recording: Recording) -> bytes:
    """Return the layout for what `write_drawable` writes of a recording.

    Cost: that of reading its states.

    Raises:
        RecordingError: The recording is damaged, or not a run's.
    """
    sensors = births_of(recording).names
    states = (recorded.message for recorded in recording.messages(("state",)))
    heights = (state.height for state in states if isinstance(state, wire.State))
    images = options_of(recording).frames > 0
    return layout(sensors, max(heights, default=0), images)


def write_drawable(path: Path, recording: Recording) -> int:
    """Write what viewers draw of a recording; return how many ticks there were.

    Memory is bounded. Time: that of reading, of learning once more, and of a scene
    for each tenth of a second.

    Args:
        path: What is there is replaced.
        recording: A run's.

    Raises:
        RecordingError: The recording is damaged, or not a run's.
        OSError: It cannot be written.
    """
    births = births_of(recording)
    sensors = births.names
    with Sink(path, sensors) as sink:
        drawing = _Drawing(sink, recording, births)
        for recorded in recording.messages((*COPIED, "keyframe", "band")):
            sink.copy(recorded)
            drawing.take(recorded)
        drawing.end()
        images = options_of(recording).frames > 0
        sink.attach(LAYOUT, layout(sensors, drawing.height, images))
    return drawing.ticks


class _Drawing:
    """Derives from each message what is drawn of it."""

    def __init__(self, sink: Sink, recording: Recording, births: Births) -> None:
        options = options_of(recording)
        self.ticks = 0
        self.height = 0
        """Edges on the longest chain there was."""
        self._sink = sink
        self._path = recording.path
        self._count = len(options.sensors)
        self._support = options.support
        self._names = births.names
        self._resumed = frozenset(resumed_at(recording))
        self._frames = Gathering()
        self._order = InOrder(recording)
        self._scenes = _Scenes(sink, LearnedOrders(recording, options), births)

    def take(self, recorded: Recorded) -> None:
        """Draw a message.

        Raises:
            RecordingError: It is of other sensors, or out of order.
            OSError: The disk does not take what is drawn.
        """
        self._scenes.open(recorded.log_time)
        try:
            self._draw(recorded.message, recorded.log_time)
        except (InvalidValueError, MessageError) as error:
            raise RecordingError(f"{self._path}: {error}") from error
        if (start := self._frames.take(recorded)) is not None:
            self._scenes.offer(start)
        self._show(self._order.add(recorded))

    def end(self) -> None:
        """Draw what is left.

        Raises:
            OSError: The disk does not take what is drawn.
        """
        self._show(self._order.rest())
        self._scenes.end()

    def _draw(self, message: wire.Message, time: int) -> None:
        count = self._count
        said: wire.Message | None = message
        if isinstance(message, wire.Anomaly):
            said = with_support(message, self._support)
        line = None if said is None else line_of(said, self._names, time)
        if line is not None:
            self._sink.put(LOG, line, time)
        match message:
            case wire.Observation(tick=tick):
                if tick - 1 in self._resumed:
                    self._sink.put(LOG, resumed_line(time, tick - 1), time)
                literals = selection(*readings(message, count))
                self._sink.put(READINGS, self._signs(literals), time)
            case wire.State():
                self.height = max(self.height, message.height)
                literals = unpack(message.literals, 2 * count)
                self._sink.put(BELIEVED, self._signs(literals), time)
            case _:
                pass

    def _signs(self, literals: NDArray[np.bool_]) -> dict[str, int]:
        """Return a number a sensor, by which of its literals is there."""
        signs = np.where(literals[::2], 1, np.where(literals[1::2], 0, UNKNOWN))
        # What was never grown has no name.
        return dict(zip(self._names, signs.tolist(), strict=False))

    def _show(self, ticks: list[Tick]) -> None:
        self.ticks += len(ticks)
        for tick in ticks:
            self._scenes.take(tick)


class _Scenes:
    """Draws the order and the state, each where it changed, and not too often."""

    def __init__(self, sink: Sink, learning: LearnedOrders, births: Births) -> None:
        self._sink = sink
        self._learning = learning
        self._births = births
        self._sensorium = Sensorium(births.body.sensors)
        self._lost = False
        self._drawn = -1  # when; nothing was yet
        self._waiting: NDArray[np.bool_] | None = None
        self._settled = 0
        self._order: tuple[bytes, list[int]] | None = None

    def open(self, time: int) -> None:
        """Draw what was known before the first tick, unless that was done already.

        Without it, whoever opens the file would look at nothing until the first state.

        Args:
            time: When the drawing begins, nanoseconds since the epoch.
        """
        if self._drawn < 0:
            self._settled = time
            self._draw(np.zeros(len(self._learning.graph), np.bool_))

    def offer(self, start: Start) -> None:
        """Take note of a key-frame; see `LearnedOrders.offer`."""
        self._learning.offer(start)

    def take(self, tick: Tick) -> None:
        """Learn from a tick, and draw it if it is time.

        Behind a tick that is missing nothing is drawn up to the next key-frame: an
        order that was learned without one of its observations is another.
        """
        follows = self._learning.take(tick)
        told, self._lost = self._lost, not follows
        if not follows:
            if told:
                return
            missing, time = self._learning.tick + 1, max(self._settled, tick.settled)
            self._sink.put(LOG, lost_line(time, missing), time)
            return
        if tick.state is None:
            return
        literals = unpack(tick.state.literals, 2 * len(self._sensorium))
        self._waiting, self._settled = literals, tick.settled
        if self._settled - self._drawn >= _EVERY:
            self._draw(literals)

    def end(self) -> None:
        """Draw the last tick, if that is still to be done."""
        if self._waiting is not None:
            self._draw(self._waiting)

    def _draw(self, literals: NDArray[np.bool_]) -> None:
        graph, time = self._learning.graph, self._settled
        read = self._births.read_at(self._learning.tick)
        drawn = graph.wires("hasse").tobytes(), read
        if drawn != self._order:
            self._order = drawn
            order = order_scene(graph, self._sensorium, time, read)
            self._sink.put(GRAPH, order, time)
        self._sink.put(STATE, state_scene(graph, literals, time, read), time)
        self._drawn, self._waiting = time, None
