"""What readings say, or what a run has learned, as a table or a graph."""

from dataclasses import dataclass

import msgspec

from neurosnap.apps.export.graph_text import Diagram, Format, diagram, render
from neurosnap.apps.export.relations import Answered
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.pair_counts import OnProgress
from neurosnap.poc.learning.relation_table import tabulate
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.recording.read.observations import readings_of
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.births import Births, births_of
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.runtime.preflight import free_memory
from neurosnap.sources.tables.readings import Readings

SURE = "sure"
"""The rule by which a table is made of what readings leave no doubt about."""
_BYTES_A_PAIR = 100
"""Of two sensors: their counts and what is judged of them. Measured: 85, of 2,000."""


@dataclass(frozen=True)
class Findings:
    """What is known of some sensors, and from which readings."""

    source: str
    """What the readings are of."""
    readings: Readings
    how: str
    """By which rule, in words."""
    snapshot: Snapshot | None = None
    """What was learned; None if only what is sure is told."""
    recording: Recording | None = None
    """Where the readings are recorded."""
    births: Births | None = None
    """What had been grown, where this is what a run has learned."""

    @property
    def sure(self) -> bool:
        """Whether only what is sure is told."""
        return self.snapshot is None

    @property
    def recorded(self) -> bool:
        """Whether a run has learned it."""
        return self.births is not None

    def table(
        self, every: bool = False, on_progress: OnProgress | None = None
    ) -> Answered:
        """Return its relations, and those that follow from others if `every`."""
        columns, births = self.readings.columns, self.births
        rows = tabulate(columns, self.snapshot, every, on_progress)
        room = births.body.room - len(births.at(columns.ticks)) if births else 0
        return Answered(self.source, self.readings, rows, self.how, room)

    def graph(self, form: Format) -> str:
        """Return the order as text for programs.

        Raises:
            InvalidValueError: Nothing is learned but what is sure, which is no order.
        """
        if (drawn := self._diagram()) is None:
            rule = "must go with --threshold, or a recording without it"
            raise InvalidValueError("format", rule, form)
        return render(drawn, form)

    def facts(self, answered: Answered) -> dict[str, object]:
        """Return all of it for programs: the table, and the order that was learned."""
        facts: dict[str, object] = msgspec.to_builtins(answered.facts())
        drawn = self._diagram()
        return facts if drawn is None else {**facts, "order": drawn}

    def _diagram(self) -> Diagram | None:
        if (known := self.snapshot) is None:
            return None
        ticks = self.readings.columns.ticks
        return diagram(ticks, known.poc_graph(), known.sensorium, self.births)


def learned_from(
    source: str,
    found: Recording | Readings,
    threshold: float | str | None = None,
    at: int | None = None,
    on_progress: OnProgress | None = None,
) -> Findings:
    """Return what readings tell, or what the run of a recording has learned.

    Args:
        source: What `found` is called.
        found: The readings, or the recording.
        threshold: Learn with this threshold; ``sure``: tell only what is sure. None:
            what the run has learned, and of readings what is sure.
        at: The last tick to go by; None for the last.
        on_progress: Told how much is done, and of how much.

    Raises:
        InvalidValueError: The threshold or the tick is out of range, or there are more
            sensors than there is memory for all their pairs.
        RecordingError: The recording is damaged.
    """
    recording = found if isinstance(found, Recording) else None
    if isinstance(found, Recording):
        tick, snapshot = snapshot_at(found, at)
        readings = readings_of(found, snapshot.sensorium, tick)
        if threshold is None:
            how = f"learned by tick {tick}"
            births = births_of(found)
            return Findings(source, readings, how, snapshot, recording, births)
    elif at is not None:
        raise InvalidValueError("at", "must go with a recording", at)
    else:
        readings = found
    _check_room(len(readings.columns.sensorium))
    if threshold is None or threshold == SURE:
        how = "by the table's own rule"
        return Findings(source, readings, how, None, recording)
    fitted = EmpiricalSnapshot.fit(readings.columns, threshold, on_progress=on_progress)
    return Findings(source, readings, f"threshold {threshold}", fitted, recording)


def _check_room(sensors: int) -> None:
    """Refuse more sensors than there is memory for all their pairs.

    Raises:
        InvalidValueError: There are more.
    """
    needed, free = _BYTES_A_PAIR * sensors * (sensors - 1) // 2, free_memory()
    if needed > free:
        rule = (
            f"must be fewer here: their pairs take {needed / 1e9:,.1f} GB, free are"
            f" {free / 1e9:.1f} GB (choose some with --sensors)"
        )
        raise InvalidValueError("sensors", rule, sensors)
