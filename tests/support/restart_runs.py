"""A short run in a path world, for tests of restarts, and the files that it writes."""

from pathlib import Path

from neurosnap.protocol.run_options import RunOptions
from tests.support.run_options import options_for


def options_of(ticks: int, *, seed: int = 3) -> RunOptions:
    return options_for(
        "neurosnap/Path-v0",
        seed,
        {"places": 5},
        ticks=ticks,
        cells="inline",
        workers=0,  # as processes are
        keyframe_every=20,
    )


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())
