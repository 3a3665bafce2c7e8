"""Readings and recordings as input for the tested commands."""

from pathlib import Path

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from tests.support.command_line import happy
from tests.support.rewritten_recordings import changing, rewritten, write_again


def readings(rows: int) -> str:
    """Return a CSV in which `a` implies `b`, and `c` goes its own way."""
    lines = ["a,b,c"]
    for row in range(rows):
        a, b, c = row % 3 == 0, row % 3 != 1, row % 5 < 2
        lines.append(f"{a:d},{b:d},{c:d}")
    return "\n".join(lines) + "\n"


def record_path(path: Path) -> Path:
    """Record a path of 20 sensors, 30 ticks."""
    happy(
        "run", "neurosnap/Path-v0", "--ticks", 30, "--seed", 4, "--threshold", 0.1,
        "--cells", "inline", "--out", path,
    )  # fmt: skip
    return path


def changed(log: Path, target: Path) -> Path:
    """Record again what `log` holds, with another decision at tick 9."""
    lie = changing(
        wire.Decision, lambda m: m.tick == 9, lambda m: {"action": m.action + 1}
    )
    return rewritten(log, target, lie)


def cut(log: Path, target: Path, *, chunk: int = 1000) -> Path:
    """Record again what `log` holds, in small chunks; take three quarters off."""
    recording, whole = Recording.open(log), target.with_suffix(".whole")
    write_again(recording, whole, recording.messages(), chunk=chunk)
    target.write_bytes(whole.read_bytes()[: whole.stat().st_size // 4])
    return target


def foreign(target: Path) -> Path:
    target.write_bytes(b"PK\x03\x04 this is no recording" * 20)
    return target
