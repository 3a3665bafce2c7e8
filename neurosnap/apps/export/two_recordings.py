"""What differs between two recordings of a machine, as a table, a page or JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import msgspec

from neurosnap.apps.export.relations import (
    check_room,
    csv_of,
    form_of,
    is_recording,
    open_data,
    page_of,
)
from neurosnap.apps.new_files import placed
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.compare_tables import (
    FEW,
    Difference,
    Differences,
    compare_tables,
)
from neurosnap.poc.learning.pair_occasions import OnProgress
from neurosnap.recording.read.recorded_readings import readings_of
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.sensorium import Sensorium, visible
from neurosnap.sources.conditions import Condition
from neurosnap.sources.cuts import known_order
from neurosnap.sources.open_readings import settled
from neurosnap.sources.readings import Readings, regular_period
from neurosnap.sources.wanted import Wanted

HEADS = ("change", "what", "before", "now", "by chance")
"""What stands above the cells of a row."""
FORMS = (".csv", ".json", ".html")
"""What a file may end with that all of it is written to."""


@dataclass(frozen=True)
class Contrast:
    """What differs between two recordings."""

    names: tuple[str, str]
    ticks: tuple[int, int]
    sensors: int
    """How many are in both."""
    alone: tuple[list[str], list[str]]
    """The sensors that only one has."""
    found: Differences

    def lines(self) -> list[str]:
        """Say whether something changed, what to suspect, and what was not compared."""
        ticks = "{} and {} ticks".format(*self.ticks)
        among = f"in {self.found.relations} relations of {self.sensors} sensors"
        count = len(self.found.rows)
        differ = f"changed: {count} difference{'s' * (count > 1)}"
        said = differ if count else "same: nothing differs"
        lines = [f"{said} beyond chance {among} ({ticks})"]
        if count:
            lines.append(f"suspect first: {', '.join(self.found.suspects)}")
        if few := self.found.untested:
            lines.append(f"tested under {FEW} times in one of them: {few} relations")
        for name, sensors in zip(self.names, self.alone, strict=True):
            if sensors:
                lines.append(f"only in {name}: {', '.join(sensors)}")
        return [visible(line) for line in lines]

    def facts(self) -> dict[str, object]:
        """Return all of it for programs."""
        return {
            "first": visible(self.names[0]),
            "second": visible(self.names[1]),
            "ticks": self.ticks,
            "changed": bool(self.found.rows),
            "suspects": self.found.suspects,
            "relations": self.found.relations,
            "untested": self.found.untested,
            "only_first": self.alone[0],
            "only_second": self.alone[1],
            "differences": [asdict(row) for row in self.found.rows],
        }

    def cells(self, row: Difference) -> tuple[str, ...]:
        """Return the cells of a row, in the order of `HEADS`."""
        word = "failed " if row.b else ""
        before = f"{word}{row.failed} of {row.tested}"
        now = f"{word}{row.failed_new} of {row.tested_new}"
        return row.change, visible(row.relation), before, now, f"{row.chance:.1g}"

    def write(self, out: Path, *, force: bool, reads: Sequence[Path]) -> None:
        """Write all of it; as `Findings.write`, which reads one file."""
        match form_of(out, FORMS):
            case ".csv":
                names = [*Difference.__dataclass_fields__]
                text = csv_of(names, map(asdict, self.found.rows))
            case ".json":
                text = msgspec.json.encode(self.facts()).decode() + "\n"
            case _:
                cells = map(self.cells, self.found.rows)
                said = "; ".join(self.lines())
                text = page_of(" and ".join(self.names), said, HEADS, cells)
        paths = [path for data in reads for path in part_paths(data).values()]
        with placed(out, force=force, reads=paths) as draft:
            draft.write_text(text, encoding="utf-8")


def open_second(
    data: Path, wanted: Wanted, first: Recording | Readings
) -> Recording | Readings:
    """Open what is compared, its numbers cut as those of the first; see `open_data`."""
    cuts = None if isinstance(first, Recording) else first.wanted.cuts
    if not cuts or is_recording(data):
        return open_data(data, wanted)
    try:
        return open_data(data, replace(wanted, cuts=cuts))
    except InvalidValueError:  # it may have numbers that the first has not
        own = settled(str(data), wanted)
        return open_data(data, replace(own, cuts={**(own.cuts or {}), **cuts}))


def contrast(
    names: tuple[str, str],
    found: tuple[Recording | Readings, Recording | Readings],
    on_progress: OnProgress | None = None,
) -> Contrast:
    """Return what differs between two recordings.

    Args:
        names: What these are called.
        found: What they hold.
        on_progress: Called with how much is done, and of how much.

    Raises:
        InvalidValueError: They have no sensor in common, or more than there is memory
            for all their pairs.
        RecordingError: A recording is damaged.
    """
    (first, conditions, one), (second, _, other) = map(_read, found)
    tables, period = (first, second), one * (one == other)
    there = [table.sensorium.names for table in tables]
    both = [name for name in there[0] if name in set(there[1])]
    if not both:
        raise InvalidValueError(names[1], f"must have a sensor of {names[0]}", "none")
    check_room(len(both))
    shared = []
    for table in tables:
        places = [table.sensorium.literal(name) >> 1 for name in both]
        words = table.on[places], table.off[places]
        shared.append(Columns(Sensorium(both), table.ticks, *words))
    alone = [[name for name in some if name not in set(both)] for some in there]
    return Contrast(
        names,
        (first.ticks, second.ticks),
        len(both),
        (alone[0], alone[1]),
        compare_tables(
            shared[0], shared[1], known_order(both, conditions), on_progress, period
        ),
    )


def _read(
    found: Recording | Readings,
) -> tuple[Columns, Mapping[str, Condition], float]:
    """Return readings, when the sensors are on that are conditions, and the period."""
    if not isinstance(found, Recording):
        return found.columns, found.wanted.every_condition(), regular_period(found)
    tick, snapshot = snapshot_at(found)
    readings = readings_of(found, snapshot.sensorium, tick)
    return readings.columns, found.options.conditions, regular_period(readings)
