"""The relations that readings support, as text, CSV or JSON."""

import csv
import io
import math
from collections.abc import Iterator, Sequence

import msgspec

from neurosnap.poc.learning.relation_table import Relation
from neurosnap.sensorium import visible
from neurosnap.sources.tables.readings import Readings
from neurosnap.system.csv_text import as_text

_HEADS = ("relation", "tested", "failed", "held in", "since", "last failure")


class RelationsAnswer(msgspec.Struct, frozen=True):
    """What was found, with all that is needed to read it."""

    source: str
    """What the readings are of."""
    sensors: int
    ticks: int
    learned: str
    """How the relations were chosen."""
    relations: list[dict[str, object]]
    """As the attributes of `neurosnap.poc.learning.relation_table.Relation`, and the
    moments of its ticks, where these are known."""


class Answered:
    """The relations found in some readings, ready to be shown.

    Args:
        source: What the readings are of.
        readings: These.
        rows: The relations, the strongest first.
        learned: How they were chosen, in words.
        room: Sensors among them that there is room for, and that were never grown.
    """

    def __init__(
        self,
        source: str,
        readings: Readings,
        rows: Sequence[Relation],
        learned: str,
        room: int = 0,
    ) -> None:
        self.source, self.readings, self.rows = source, readings, rows
        self.learned = learned
        self.sensors = len(readings.columns.sensorium) - room

    @property
    def title(self) -> str:
        """One line that says how much there is."""
        found, ticks = len(self.rows), self.readings.columns.ticks
        noun = "relation" if found == 1 else "relations"
        return (
            f"{found} {noun} of {self.sensors} sensors in {ticks} ticks"
            f" ({self.learned})"
        )

    def facts(self) -> RelationsAnswer:
        """Return it for programs."""
        relations: list[dict[str, object]] = []
        for row in self.rows:
            facts = dict(_fields(row))
            if self.readings.times is not None:
                facts["since_time"] = self.readings.moment(row.since)
                facts["last_failure_time"] = self.readings.moment(row.last_failure)
            relations.append(facts)
        return RelationsAnswer(
            visible(self.source),
            self.sensors,
            self.readings.columns.ticks,
            self.learned,
            relations,
        )

    def lines(self, most: int | None = None) -> Iterator[str]:
        """Yield the table as text.

        Args:
            most: Rows to show at most; None for all.
        """
        shown = self.rows if most is None else self.rows[:most]
        cells = [_HEADS, *(self.cells(row) for row in shown)]
        if len(cells) == 1:
            return
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        for line in cells:
            padded = [
                cell.ljust(width) if place == 0 else cell.rjust(width)
                for place, (cell, width) in enumerate(zip(line, widths, strict=True))
            ]
            yield "  ".join(padded).rstrip()

    def cells(self, row: Relation) -> tuple[str, ...]:
        """Return what a row shows, in the order of the heads."""
        both = row.relation in ("the same", "opposite") or "nearly" in row.relation
        failed = f"{row.failed} + {row.failed_back}" if both else str(row.failed)
        # Down, so that what failed once in ten thousand ticks does not say 100 %.
        share = f"{math.floor(10_000 * row.share) / 100:.2f} %".replace(".00 %", " %")
        return (
            visible(row.sentence),
            f"{row.tested} + {row.tested_back}",
            failed,
            share,
            self._tick(row.since),
            self._tick(row.last_failure) if row.last_failure else "never",
        )

    def csv(self) -> str:
        """Return it as CSV, a row a relation."""
        names = list(Relation.__dataclass_fields__)
        timed = self.readings.times is not None
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow([*names, *(["since_time", "last_failure_time"] * timed)])
        for row in self.rows:
            cells = [
                as_text(value) if isinstance(value, str) else value
                for value in _fields(row).values()
            ]
            if timed:
                moments = map(self.readings.moment, (row.since, row.last_failure))
                cells.extend(map(as_text, moments))
            writer.writerow(cells)
        return buffer.getvalue()

    def json(self) -> str:
        """Return it as JSON, indented."""
        return msgspec.json.format(msgspec.json.encode(self.facts())).decode()

    def _tick(self, tick: int) -> str:
        moment = visible(self.readings.moment(tick))
        return f"{tick} ({moment})" if moment else str(tick)


HEADS = _HEADS
"""What stands above the cells of a row."""


def _fields(row: Relation) -> dict[str, object]:
    return {name: getattr(row, name) for name in Relation.__dataclass_fields__}
