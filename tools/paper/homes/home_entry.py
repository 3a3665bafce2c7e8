"""Table entries of the figure of homes: one of each table, home and budget."""

import hashlib
from pathlib import Path
from typing import ClassVar, Literal, TypeAlias, get_args

import msgspec
import numpy as np
from numpy.typing import DTypeLike, NDArray

from tools.paper.homes import cases
from tools.paper.homes.faults import LONG
from tools.paper.homes.home import (
    homes_in,
)
from tools.paper.homes.methods import METHODS, bench
from tools.paper.table import Entry

TableKind: TypeAlias = Literal["segments", "long", "week", "clean"]
TABLES: tuple[TableKind, ...] = get_args(TableKind)
MOST = (64, 512)
"""Known sensors, and days, that there is room for in a table."""


class HomeEntry(Entry, frozen=True, kw_only=True):
    """What every method says of one home, as `cases` describes."""

    VERSION = 3
    dtype: ClassVar[DTypeLike] = np.float64

    table: TableKind
    home: str
    """The name of its file."""
    digest: str
    """SHA-256 of the file."""
    alarms: str
    """The budget of the health monitor."""
    path: str
    """Where the file is; no part of the key."""

    @property
    def name(self) -> str:
        """What people see of it in a listing of files."""
        return f"home-{self.home}-{self.table}"

    @property
    def key(self) -> str:
        """All that its rows depend on, as JSON."""
        return super(HomeEntry, msgspec.structs.replace(self, path="")).key

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of a row; there is room to spare."""
        methods, (sensors, days) = len(METHODS), MOST
        shapes: dict[TableKind, tuple[int, ...]] = {
            "segments": (
                len(cases.KINDS),
                cases.CASES,
                methods,
                len(cases.SEGMENT_FIELDS),
            ),
            "long": (len(LONG), sensors, cases.ONSETS, methods),
            "week": (2, sensors, methods, len(cases.WEEK_FIELDS)),
            "clean": (methods, days),
        }
        return shapes[self.table]

    def row(self, run: int) -> NDArray[np.float64]:
        """Return what came of one seed; what there is no case for is not a number."""
        ready = bench(self.path, self.alarms)
        seed = self.seed + run
        made = {
            "segments": lambda: cases.segments(ready, seed),
            "long": lambda: cases.long_faults(ready, seed),
            "week": lambda: cases.last_week(ready, seed),
            "clean": lambda: cases.clean_days(ready),
        }[self.table]()
        row = np.full(self.shape, np.nan)
        fits = tuple(
            slice(min(have, room))
            for have, room in zip(made.shape, self.shape, strict=True)
        )
        row[fits] = made[fits]
        return row


def entries(folder: Path, alarms: str, runs: int, seed: int) -> list[HomeEntry]:
    """Return the entries of all homes in a folder, by home and table."""
    made = []
    for path in homes_in(folder):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        made += [
            HomeEntry(
                table=table,
                home=path.stem,
                digest=digest,
                alarms=alarms,
                runs=1 if table == "clean" else runs,
                seed=seed,
                path=str(path),
            )
            for table in TABLES
        ]
    return made
