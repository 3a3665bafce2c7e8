"""Each process that runs tests has ports of its own."""

import subprocess
import sys
from pathlib import Path

from tests.support.ports import free_port

ASK = (
    "from tests.support.ports import free_port; print([free_port() for _ in range(50)])"
)


def test_two_processes_are_given_different_ports() -> None:
    ours = {free_port() for _ in range(50)}
    assert len(ours) == 50
    done = subprocess.run(
        [sys.executable, "-c", ASK],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=True,
    )
    theirs = {int(number) for number in done.stdout.strip("[]\n").split(",")}
    assert len(theirs) == 50
    assert not ours & theirs
