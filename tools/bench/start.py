"""Measures what a newcomer waits for: what is installed, the help, a first run."""

import os
import resource
import subprocess
import sys
import tempfile
import time
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tools.bench.report import Line, Sizes

_START, _FIRST = 0.15, 1.2
_NAMED = 6  # of the packages, the largest
_RUN = [sys.executable, "-m", "neurosnap", "run", "neurosnap/Path-v0"]


def start(sizes: Sizes) -> list[Line]:
    """Time what a newcomer waits for: the help, and a first run beside a later one."""
    lines = []
    bare = _best([sys.executable, "-c", "pass"])
    for words in ["-c", "import neurosnap"], ["-m", "neurosnap", "--help"]:
        took = _best([sys.executable, *words])
        lines.append(
            Line(
                f"python {' '.join(words)}: processor time",
                f"{took * 1e3:.0f} ms",
                f"python alone {bare * 1e3:.0f} ms",
                f"≤ {_START * 1e3:g} ms",
                took <= _START,
                {"seconds": took, "bare_seconds": bare},
            )
        )
    first, later = list[float](), list[float]()
    for _ in range(sizes.pairs):
        with tempfile.TemporaryDirectory(prefix="bench-") as folder:
            for times in first, later:
                log = f"{folder}/{len(times)}-{len(first)}.mcap"
                began = time.perf_counter()
                _processor_time(
                    [*_RUN, "--ticks", f"{sizes.ticks}", "--out", log], folder
                )
                times.append(time.perf_counter() - began)
    ratio = min(first) / min(later)
    sizes_of = dict[str, int]()
    _add_needed("neurosnap-uma", sizes_of)
    total = sum(sizes_of.values())
    largest = sorted(sizes_of, key=sizes_of.__getitem__)[: -_NAMED - 1 : -1]
    return [
        *lines,
        Line(
            f"a default install: {len(sizes_of)} packages",
            f"{total / 1e6:.0f} MB",
            ", ".join(f"{name} {sizes_of[name] / 1e6:.0f}" for name in largest),
            figures={"packages": len(sizes_of), "bytes": total},
        ),
        Line(
            f"a first run of 20 cells, {sizes.ticks} ticks",
            f"{min(first):.1f} s ({ratio:.2f} ×)",
            f"a later one {min(later):.1f} s",
            "≤ 1.2 ×",
            ratio <= _FIRST,
            {"seconds": min(first), "later_seconds": min(later), "ratio": ratio},
        ),
    ]


def _add_needed(package: str, sizes: dict[str, int]) -> None:
    """Add the sizes in bytes of a package and of all it needs without an extra."""
    name = canonicalize_name(package)
    if name in sizes:
        return
    found = distribution(name)
    files = (Path(file.locate()) for file in found.files or ())
    sizes[name] = sum(file.stat().st_size for file in files if file.is_file())
    for text in found.requires or ():
        one = Requirement(text)
        if one.marker is None or one.marker.evaluate({"extra": ""}):
            _add_needed(one.name, sizes)


def _best(words: list[str]) -> float:
    return min(_processor_time(words) for _ in range(5))


def _processor_time(words: list[str], cache: str = "") -> float:
    """Return the processor time of a command; what it compiles is kept in `cache`."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    keeps = {"NUMBA_CACHE_DIR": cache} if cache else {}
    subprocess.run(words, check=True, capture_output=True, env=os.environ | keeps)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
