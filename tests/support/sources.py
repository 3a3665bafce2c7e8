"""Files of readings, and the observations that sources make of them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from neurosnap.sources.protocol import Observed, Source

README = """\
door,motion
0,1
1,1
1,0
"""


def written(folder: Path, text: str | bytes, name: str = "readings.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def readings(seen: Observed) -> list[bool | None]:
    """Return what was read; None if it is unknown."""
    known = np.ones(len(seen.bits), np.bool_) if seen.known is None else seen.known
    return [bool(b) if k else None for b, k in zip(seen.bits, known, strict=True)]


def first(source: Source) -> NDArray[np.bool_]:
    seen = source.first()
    assert seen is not None
    return seen.bits


def everything(source: Source, actions: Iterator[int] | None = None) -> list[list[int]]:
    seen = [first(source).astype(int).tolist()]
    while (after := source.step(0 if actions is None else next(actions))) is not None:
        seen.append(after.bits.astype(int).tolist())
    return seen


def walked(source: Source, steps: int = 100) -> NDArray[np.bool_]:
    rng = np.random.default_rng(0)
    seen = [first(source)]
    for _ in range(steps):
        after = source.step(int(rng.integers(len(source.actions))))
        assert after is not None
        seen.append(after.bits)
    return np.array(seen)
