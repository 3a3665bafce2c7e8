"""A source is opened by its name."""

from pathlib import Path
from typing import TYPE_CHECKING

from neurosnap.sources.csv_source import CsvSource
from neurosnap.sources.gymnasium_source import GymnasiumSource

if TYPE_CHECKING:
    from neurosnap.sources.protocol import Source


def test_both_kinds_are_sources(readings: Path) -> None:
    kinds: list[Source] = [
        CsvSource(str(readings)),
        GymnasiumSource("neurosnap/Path-v0", 0),
    ]
    assert [len(kind.actions) for kind in kinds] == [0, 2]
