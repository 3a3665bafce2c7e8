"""Commands that read a recording stop at Ctrl-C, before they unpack another chunk."""

import os
import signal
from pathlib import Path
from typing import NoReturn

import pytest
from typer.testing import CliRunner

from neurosnap.apps.cli import app
from neurosnap.recording.format import chunk_index
from neurosnap.system.signals import INTERRUPTED, quit_now


@pytest.mark.slow
@pytest.mark.parametrize(
    "line", ["info", "verify", "export -o a.csv", "export -o a.mcap"]
)
def test_ctrl_c_ends_what_reads_a_recording(
    path_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    unpack, unpacked = chunk_index._unpack_zstd, []

    def interrupted(packed: bytes, size: int) -> bytes:
        unpacked.append(size)
        os.kill(os.getpid(), signal.SIGINT)
        return unpack(packed, size)

    def leave(code: int) -> NoReturn:
        raise SystemExit(code)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(chunk_index, "_unpack_zstd", interrupted)
    monkeypatch.setattr("neurosnap.system.signals.os._exit", leave)
    before = signal.signal(signal.SIGINT, quit_now)
    try:
        verb, *options = line.split()
        result = CliRunner().invoke(app, [verb, str(path_log), *options])
    finally:
        signal.signal(signal.SIGINT, before)
    assert (result.exit_code, len(unpacked)) == (INTERRUPTED, 1)
    assert list(tmp_path.iterdir()) == []
