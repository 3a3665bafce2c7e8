"""The relations that readings support or a run has learned, as a table or a page.

The page is one HTML file that loads nothing: no script, no font, no picture from
elsewhere, which its policy forbids as well.
"""

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from neurosnap.apps.export.order_picture import plot_order
from neurosnap.apps.new_files import placed
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.beyond_pairs import USUAL_LIMITS, Limits
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.pair_occasions import OnProgress
from neurosnap.poc.learning.relation_table import Relation, Relations, span_of, tabulate
from neurosnap.poc.order.graph import PocGraph
from neurosnap.recording.format.records import MAGIC
from neurosnap.recording.read.recorded_readings import readings_of
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.grown_sensors import Births, births_of
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.runtime.preflight import free_memory
from neurosnap.sensorium import Sensorium, visible
from neurosnap.sources.bag_records import is_bag
from neurosnap.sources.csv_cells_and_formulas import as_text
from neurosnap.sources.cuts import known_order
from neurosnap.sources.open_readings import first_bytes, open_readings
from neurosnap.sources.readings import Readings, regular_period
from neurosnap.sources.wanted import Wanted

if TYPE_CHECKING:
    from neurosnap.poc.learning.snapshot import Snapshot

HEADS = "relation", "tested", "failed", "promised", "held in", "since", "last failure"
"""What stands above the cells of a row."""
SURE = "sure"
"""The rule by which a table is made of what readings leave no doubt about."""
_ALL = Wanted()
_FORMS = (".csv", ".html")
_BYTES_A_PAIR = 120
"""Of two sensors: their counts and what is judged of them. Measured: 105, of 2,000."""


def open_data(data: Path, wanted: Wanted = _ALL) -> Recording | Readings:
    """Return the recording in a file, or else the readings in it that are wanted.

    Raises:
        InvalidValueError: The file cannot be read, or breaks a rule; or it is a
            recording, and something else than all of it is wanted.
        RecordingError: It is a recording that cannot be read.
    """
    if not is_recording(data):
        return open_readings(str(data), wanted)
    if wanted != _ALL:
        rule = "must not go with a recording, whose sensors are known"
        raise InvalidValueError("sensors, when or time", rule, str(data))
    return Recording.open(data)


def is_recording(data: Path) -> bool:
    """Return whether a file is to be read as a run's own recording."""
    if data.exists() and is_bag(str(data)):
        return False
    named = data.suffix.lower() == ".mcap"
    return named or first_bytes(str(data)).startswith(MAGIC)


@dataclass(frozen=True)
class Findings:
    """The relations of some sensors."""

    source: str
    """What the readings are of."""
    readings: Readings
    how: str
    """By which rule, in words."""
    rows: Relations
    """The strongest first."""
    births: Births | None = None
    """What had been grown, where this is what a run has learned."""
    lag: int = 0
    """The longest lag that was asked for."""
    period: float = 0.0
    """Seconds from tick to tick; 0: not always as many, or not known."""

    @property
    def sensors(self) -> int:
        """How many sensors it is about, without those that were never grown."""
        columns, births = self.readings.columns, self.births
        room = births.body.room - len(births.at(columns.ticks)) if births else 0
        return len(columns.sensorium) - room

    @property
    def title(self) -> str:
        """One line that says how much it holds."""
        found, ticks = len(self.rows), self.readings.columns.ticks
        noun = "relation" if found == 1 else "relations"
        return f"{found} {noun} of {self.sensors} sensors in {ticks} ticks ({self.how})"

    @property
    def check(self) -> str:
        """Lines that say how well such promises held, and what was passed over."""
        kept, made = self.rows.kept, self.rows.made
        said = f"{kept} of {made} promises of the first half held in the second"
        lines = [said] if made else []
        if self.rows.left:
            lines.append(
                f"passed over, being too many: {self.rows.left} sets of sensors"
            )
        if self.rows.lag < self.lag:
            most = span_of(self.rows.lag, self.period)
            lines.append(f"of so many sensors no lag above {most}")
        return "\n".join(lines)

    def facts(self) -> dict[str, object]:
        """Return all of it for programs."""
        return {
            "source": visible(self.source),
            "sensors": self.sensors,
            "ticks": self.readings.columns.ticks,
            "learned": self.how,
            "made": self.rows.made,
            "kept": self.rows.kept,
            "left": self.rows.left,
            "lag": self.rows.lag,
            "relations": [self._fields(row) for row in self.rows],
        }

    def cells(self, row: Relation) -> tuple[str, ...]:
        """Return the cells of a row, in the order of `HEADS`."""
        both = row.relation.endswith(("the same", "opposite"))
        failed = f"{row.failed} + {row.failed_back}" if both else str(row.failed)
        # Down, so that what failed once in ten thousand ticks does not say 100 %.
        share = f"{math.floor(10_000 * row.share) / 100:.2f} %".replace(".00 %", " %")
        return (
            visible(self._said(row)),
            f"{row.tested} + {row.tested_back}",
            failed,
            # Up, so that no promise is told smaller than it is.
            f"≤ {math.ceil(1000 * row.at_most) / 10:g} %",
            share,
            self._tick(row.since),
            self._tick(row.last_failure) if row.last_failure else "never",
        )

    def write(self, out: Path, *, force: bool, reads: Path) -> None:
        """Write all of it in the form that the ending of a file asks for.

        Args:
            out: The file.
            force: Replace what is there.
            reads: The data; nothing replaces these.

        Raises:
            InvalidValueError: A file is there already, or no folder for it.
            OSError: It cannot be written.
        """
        if form_of(out) == ".csv":
            times = ["since_time", "last_failure_time"]
            timed = times if self.readings.times is not None else []
            names = [*Relation.__dataclass_fields__, "sentence", *timed]
            text = csv_of(names, map(self._fields, self.rows))
        else:
            cells = map(self.cells, self.rows)
            said = ". ".join(filter(None, (self.title, self.check)))
            text = page_of(self.source, said, HEADS, cells, _figure(self.rows))
        with placed(out, force=force, reads=part_paths(reads).values()) as draft:
            draft.write_text(text, encoding="utf-8")

    def _fields(self, row: Relation) -> dict[str, object]:
        """Return a row, its sentence, and the moments of its ticks, if known."""
        fields = {**asdict(row), "sentence": self._said(row)}
        if self.readings.times is not None:
            fields["since_time"] = self.readings.moment(row.since)
            fields["last_failure_time"] = self.readings.moment(row.last_failure or 0)
        return fields

    def _said(self, row: Relation) -> str:
        """Return a row in words, with how long it takes, and what it explains."""
        notes = []
        if row.usual and row.usual != row.within:
            notes.append(f"usually {span_of(row.usual, self.period)}")
        if row.explains > 0:
            notes.append(f"explains {row.explains}")
        said = row.said(self.period)
        return f"{said} ({', '.join(notes)})" if notes else said

    def _tick(self, tick: int) -> str:
        moment = visible(self.readings.moment(tick))
        return f"{tick} ({moment})" if moment else str(tick)


def csv_of(names: Sequence[str], rows: Iterable[Mapping[str, object]]) -> str:
    """Return rows as CSV, which no spreadsheet runs."""
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, names, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        texts = {k: as_text(v) if isinstance(v, str) else v for k, v in row.items()}
        writer.writerow(texts)
    return buffer.getvalue()


def page_of(
    title: str,
    summary: str,
    heads: Iterable[str],
    rows: Iterable[Sequence[str]],
    figure: str = "",
) -> str:
    """Return a table as a page that loads nothing; `figure` is HTML."""
    return _PAGE.format(
        title=escape(visible(title)),
        summary=escape(visible(summary)),
        style=_STYLE,
        figure=figure,
        heads="".join(f"<th>{escape(head)}</th>" for head in heads),
        rows="\n".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
            for row in rows
        ),
    )


def form_of(out: Path, forms: Sequence[str] = _FORMS) -> str:
    """Return the ending of a file that a table is written to.

    Raises:
        InvalidValueError: Its name ends with something else.
    """
    if out.suffix.lower() not in forms:
        rule = f"must end with one of {', '.join(forms)}"
        raise InvalidValueError("out", rule, str(out))
    return out.suffix.lower()


def learned_from(
    source: str,
    found: Recording | Readings,
    threshold: float | str | None = None,
    *,
    at: int | None = None,
    every: bool = False,
    limits: Limits = USUAL_LIMITS,
    on_progress: OnProgress | None = None,
) -> Findings:
    """Return the relations of a file of readings, or those a recorded run has learned.

    Args:
        source: What `found` is called.
        found: The readings, or the recording.
        threshold: Learn with this threshold; ``sure``: report only what is sure. None:
            what the run has learned, and of readings what is sure.
        at: The last tick to go by; None for the last.
        every: Also return the relations that follow from others.
        limits: Of what is looked for beyond pairs, where only what is sure is reported.
        on_progress: Called with how much is done, and of how much.

    Raises:
        InvalidValueError: The threshold or the tick is out of range, or there are more
            sensors than there is memory for all their pairs.
        RecordingError: The recording is damaged.
    """
    births: Births | None = None
    snapshot: Snapshot | None = None
    how = "by the table's own rule"
    if isinstance(found, Recording):
        tick, snapshot = snapshot_at(found, at)
        readings = readings_of(found, snapshot.sensorium, tick)
        conditions = found.options.conditions
        if threshold is None:
            births, how = births_of(found), f"learned by tick {tick}"
    elif at is not None:
        raise InvalidValueError("at", "must go with a recording", at)
    else:
        readings = found
        conditions = readings.wanted.every_condition()
    columns = readings.columns
    if births is None:
        check_room(len(columns.sensorium))
        if threshold is None or threshold == SURE:
            snapshot = None
        else:
            snapshot = EmpiricalSnapshot.fit(
                columns, threshold, on_progress=on_progress
            )
            how = f"threshold {threshold}"
    known = known_order(columns.sensorium.names, conditions)
    rows = tabulate(columns, snapshot, every, on_progress, known, limits)
    asked = limits.lag if snapshot is None else 0
    period = regular_period(readings)
    return Findings(source, readings, how, rows, births, asked, period)


def check_room(sensors: int) -> None:
    """Refuse more sensors than there is memory for all their pairs."""
    needed, free = _BYTES_A_PAIR * sensors * (sensors - 1) // 2, free_memory()
    if needed > free:
        rule = (
            f"must be fewer here: their pairs take {needed / 1e9:,.1f} GB, free are"
            f" {free / 1e9:.1f} GB (choose some with --sensors)"
        )
        raise InvalidValueError("sensors", rule, sensors)


_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem; color: #1c2530;
  background: #fff; }
table { border-collapse: collapse; margin: 1.5rem 0; }
th, td { padding: .25rem .9rem .25rem 0; text-align: right; white-space: nowrap;
  border-bottom: 1px solid #dde3ea; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; white-space: normal; }
figure { margin: 1.5rem 0; overflow-x: auto; }
@media (prefers-color-scheme: dark) {
  body { color: #dfe6ee; background: #12171d; } th, td { border-color: #2b3540; }
}
"""
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<h1>{title}</h1>
<p>{summary}</p>
{figure}
<table>
<thead><tr>{heads}</tr></thead>
<tbody>
{rows}
</tbody>
</table>
</body>
</html>
"""


def _figure(relations: Sequence[Relation]) -> str:
    """Return the order as a picture: what implies stands below what it implies."""
    pairs = [pair for row in relations for pair in _edges(row)]
    names = dict.fromkeys(name.removesuffix("*") for pair in pairs for name in pair)
    if not names:
        return ""
    sensors = Sensorium(names)
    implications = [(sensors.literal(a), sensors.literal(b)) for a, b in pairs]
    graph = PocGraph.from_implications(len(sensors), implications)
    try:
        picture = plot_order(graph, sensors)
    except InvalidValueError:  # too many to be read, or what contradicts itself
        return ""
    return (
        f"<figure>{picture}<figcaption>What implies stands below what it implies; a"
        " star means off.</figcaption></figure>"
    )


def _edges(row: Relation) -> list[tuple[str, str]]:
    """Return the implications between literals that a row tells."""
    match row.relation:
        case "implies" | "nearly implies":
            return [(row.a, row.b)] if row.premises == 1 else []
        case "never together" | "nearly never together":
            return [(row.a, _other(row.b))]
        case "at least one of" | "nearly at least one of":
            return [(_other(row.a), row.b)]
        case "the same" | "nearly the same":
            return list(pairwise((row.a, row.b, row.a)))
        case "opposite" | "nearly opposite":
            return list(pairwise((row.a, _other(row.b), row.a)))
        case _:  # late, which no order of what is read at once has
            return []


def _other(literal: str) -> str:
    return literal[:-1] if literal.endswith("*") else f"{literal}*"
