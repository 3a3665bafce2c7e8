"""Shows and writes the table of relations, for all verbs that have one."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from neurosnap.apps.cli.options import FLAG
from neurosnap.errors import InvalidValueError, NeurosnapError

if TYPE_CHECKING:
    from neurosnap.apps.cli.recording_info import Info
    from neurosnap.apps.export.relations import Answered
    from neurosnap.recording.read.recording import Recording

MOST = 40
"""Rows that a terminal is shown, unless they are what was asked for."""
_FEW = 10
_SMALL = 16 << 20
"""Bytes of a recording of which a table is made without being asked for."""
_FORMS = (".csv", ".json", ".html", ".txt")

Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FILE",
        help="Write the whole table to a .csv, .json, .html or .txt file, which must not"
        " exist yet.",
        show_default="the terminal",
    ),
]
Every = Annotated[
    bool,
    typer.Option(
        "--all",
        metavar=FLAG,
        help="Show the relations that follow from others, too.",
    ),
]


def learned_lines(log: Path, recording: "Recording", found: "Info") -> Iterator[str]:
    """Yield the beginning of a run's table, or where it is to be had.

    Only of what is read in a moment; and nothing of a file that cannot be read whole,
    for then what it lacks is reported.
    """
    from neurosnap.apps.export.learned import learned_from

    if "options" not in recording.metadata or not recording.whole:
        return
    if found.size > _SMALL:
        yield f"relations: neurosnap learn {log}"
        return
    try:
        answered = learned_from(str(log), recording).table()
    except NeurosnapError:
        return  # a part of a run whose beginning is elsewhere, for one
    yield f"relations: {answered.title}"
    yield from (f"  {line}" for line in answered.lines(_FEW))
    if len(answered.rows) > _FEW:
        yield f"  and {len(answered.rows) - _FEW} more: neurosnap learn {log}"


def check_out(out: Path) -> None:
    """Refuse a file that no table can be written to.

    Raises:
        InvalidValueError: Its name ends with something else.
    """
    if out.suffix.lower() not in _FORMS:
        rule = f"must end with one of {', '.join(_FORMS)}"
        raise InvalidValueError("out", rule, str(out))


def show(
    console: Console, answered: "Answered", out: Path | None, most: int | None
) -> None:
    """Print the strongest relations, and where all of them are."""
    if out is None:
        for line in answered.lines(most):
            console.print(line, markup=False, soft_wrap=True)
    console.print(answered.title, markup=False, soft_wrap=True)
    if out is not None:
        console.print(f"wrote {out}", markup=False, soft_wrap=True)
    elif most is not None and len(answered.rows) > most:
        left = len(answered.rows) - most
        console.print(f"and {left} more; all: --out FILE")


def write(answered: "Answered", out: Path, source: Path, *, force: bool) -> None:
    """Write all relations, in the form that its ending asks for.

    Raises:
        InvalidValueError: There is a file already, or no folder for it.
        OSError: It cannot be written.
    """
    from neurosnap.apps.export.write import placed

    with placed(out, force=force, reads=[source]) as draft:
        draft.write_text(_text(answered, out.suffix.lower()), encoding="utf-8")


def _text(answered: "Answered", form: str) -> str:
    match form:
        case ".csv":
            return answered.csv()
        case ".json":
            return f"{answered.json()}\n"
        case ".html":
            from neurosnap.apps.drawing.relations_page import relations_page
            from neurosnap.apps.export.relations import HEADS

            cells = [answered.cells(row) for row in answered.rows]
            return relations_page(
                answered.source, answered.title, HEADS, cells, answered.rows
            )
        case _:
            return "".join(f"{line}\n" for line in answered.lines())
