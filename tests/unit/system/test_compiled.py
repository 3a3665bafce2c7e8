"""Compiled code is cached in the user's folder, with a notice on the first start."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = """
from neurosnap.system.compiled import njit

@njit()
def twice(number):
    return 2 * number

assert twice(3) == 6
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    path = tmp_path / "program" / "kernel.py"
    path.parent.mkdir()
    path.write_text(SOURCE)
    return path


def start(program: Path, **environment: str) -> str:
    """Run the program; return what it says."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in {"XDG_CACHE_HOME", "NUMBA_CACHE_DIR"}
    }
    done = subprocess.run(
        [sys.executable, program],
        env=kept | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout + done.stderr


def compiled(folder: Path) -> list[Path]:
    return list(folder.rglob("kernel.twice-*.nbi"))


@pytest.mark.slow
def test_the_first_start_says_that_it_compiles(tmp_path: Path, program: Path) -> None:
    cache = tmp_path / "cache"
    assert "compiling for this machine" in start(program, XDG_CACHE_HOME=str(cache))
    assert compiled(cache / "neurosnap")
    assert not compiled(program.parent)
    assert start(program, XDG_CACHE_HOME=str(cache)) == ""


@pytest.mark.slow
@pytest.mark.exhaustive
def test_a_folder_for_numba_comes_first(tmp_path: Path, program: Path) -> None:
    chosen, cache = tmp_path / "chosen", tmp_path / "cache"
    said = start(program, XDG_CACHE_HOME=str(cache), NUMBA_CACHE_DIR=str(chosen))
    assert said == ""
    assert compiled(chosen)
    assert not cache.exists()


@pytest.mark.slow
@pytest.mark.exhaustive
def test_without_a_cache_folder_numba_chooses(tmp_path: Path, program: Path) -> None:
    (tmp_path / "cache").write_text("a file")
    assert start(program, XDG_CACHE_HOME=str(tmp_path / "cache")) == ""
    assert compiled(program.parent)


@pytest.mark.slow
@pytest.mark.exhaustive
def test_what_is_called_and_what_is_counted_with_may_change(tmp_path: Path) -> None:
    program, helper = tmp_path / "program.py", tmp_path / "helper.py"
    program.write_text(
        "from helper import START, step\n"
        "from neurosnap.system.compiled import njit\n"
        "walk = njit()(lambda number: START + step(step(number)))\n"
        "print(walk(1))\n"
    )
    form = (
        "from neurosnap.system.compiled import njit\n"
        "from numbers_of_ours import START\n"
        "step = njit()(lambda number: number + {})\n"
    )
    numbers = tmp_path / "numbers_of_ours.py"
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    (tmp_path / "cache" / "neurosnap").mkdir(parents=True)
    found = []
    for start_at, step in ((10, 1), (10, 5), (20, 5), (10, 1)):
        numbers.write_text(f"START = {start_at}\n")
        helper.write_text(form.format(step))
        found.append(start(program, **cache))
    assert found == ["13\n", "21\n", "31\n", "13\n"]


@pytest.mark.slow
def test_a_compiler_that_is_not_needed_is_not_loaded(tmp_path: Path) -> None:
    path = tmp_path / "lazy.py"
    path.write_text(
        "import sys\n"
        "from neurosnap.system.compiled import njit\n"
        "import neurosnap.apps.cli\n"
        "once = njit()(lambda number: number + 1)\n"
        "twice = njit()(lambda number: once(once(number)))\n"
        "print('numba' in sys.modules, twice(3), 'numba' in sys.modules)\n"
    )
    (tmp_path / "neurosnap").mkdir()
    said = start(path, XDG_CACHE_HOME=str(tmp_path))
    assert said == "False 5 True\n"
