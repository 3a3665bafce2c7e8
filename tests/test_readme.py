"""The README's blocks run as they are printed."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import PATIENCE

ROOT = Path(__file__).parent.parent
BLOCKS = re.findall(
    r"^```(\w+)\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL
)
COMMANDS = [
    line.split("#")[0].strip()
    for language, text in BLOCKS
    if language == "sh"
    for line in text.splitlines()
]
MAKE = [line for line in COMMANDS if line.startswith("make ")]
VERBS = [line for line in COMMANDS if not line.startswith("make ")]
# What the README shows of the output of a command among those.
SHOWN = {
    command: shown.splitlines()
    for language, text in BLOCKS
    if language == "console"
    for command, shown in re.findall(r"^\$ (.*)\n((?:[^$].*\n)+)", text, re.MULTILINE)
    if command in VERBS
}


@pytest.mark.parametrize("text", [t for kind, t in BLOCKS if kind == "python"])
def test_python_blocks_run(text: str) -> None:
    subprocess.run(
        [sys.executable, "-W", "error", "-c", text], check=True, timeout=PATIENCE
    )


def test_make_targets_exist() -> None:
    assert MAKE == ["make run", "make test"]
    for line in MAKE:
        dry = subprocess.run(
            [*line.split(), "--dry-run"], cwd=ROOT, capture_output=True, check=True
        )
        assert b"neurosnap run" in dry.stdout or b"pytest" in dry.stdout


@pytest.mark.zenoh
@pytest.mark.slow
def test_shell_blocks_run(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    bin_folder = str(Path(sys.executable).parent)
    environment = {**os.environ, "PATH": f"{bin_folder}:{os.environ['PATH']}"}
    assert len(VERBS) == 14
    said = {}
    for line in VERBS:
        done = subprocess.run(
            line.split(),
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert done.returncode == 0, f"{line}: {done.stderr}"
        said[line] = done.stdout.splitlines()
    assert len(SHOWN) == 2
    for line, shown in SHOWN.items():
        assert set(shown) <= set(said[line]), line
    assert (tmp_path / "depths" / "depth.png").stat().st_size > 0
    assert (tmp_path / "b.mcap").exists()
