"""Compiled code is cached in a folder of the user's own; a first start is announced."""

import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace

import pytest

from neurosnap.system import compiled as compiled_code
from neurosnap.system.compiled import interpreted, njit

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
    start(program, XDG_CACHE_HOME=str(cache), NUMBA_CACHE_DIR=str(chosen))
    assert compiled(chosen)
    assert not cache.exists()


@pytest.mark.slow
@pytest.mark.exhaustive
def test_without_a_cache_folder_nothing_is_kept(tmp_path: Path, program: Path) -> None:
    (tmp_path / "cache").write_text("a file")
    said = start(program, XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert "each start compiles anew" in said
    assert "compiling for this machine: about" in said
    assert not compiled(tmp_path)


@pytest.fixture
def kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> Iterator[Callable[[], list[bool]]]:
    """Return what tells whether the cache is used, and whether a function's part is."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    kernel = compiled_code._Kernel(len, False, len)
    compiled_code._kernels.remove(kernel)
    monkeypatch.setattr(compiled_code, "_made_of", lambda *_: [b"its source"])

    def look() -> list[bool]:
        for function in (compiled_code.cache_folder, compiled_code._say_untrusted):
            function.cache_clear()
        caplog.clear()
        return [
            compiled_code.cache_folder() is not None,
            compiled_code._folder_of(kernel) != "",
        ]

    yield look
    compiled_code.cache_folder.cache_clear()


def test_a_cache_is_used_only_where_no_other_user_can_write(
    tmp_path: Path,
    kept: Callable[[], list[bool]],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    assert kept() == [True, True]
    cache = tmp_path / "neurosnap"
    inside = cache / sha256(b"its source").hexdigest()[:16]
    inside.mkdir(mode=0o775)
    inside.chmod(0o775)
    assert kept() == [True, True]  # nobody else gets into the folder around it
    cache.chmod(0o755)
    assert kept() == [True, False]
    assert [record.message for record in caplog.records] == [
        f"{cache}: must be a folder that this user owns and no other can write to"
        " (chmod -R go-w): each start compiles anew"
    ]
    cache.chmod(0o777)
    assert kept() == [False, False]
    assert caplog.text.count("each start compiles anew") == 1
    cache.chmod(0o700)
    monkeypatch.setattr(os, "getuid", lambda: cache.stat().st_uid + 1)
    assert kept() == [False, False]


def test_a_cache_that_is_a_link_is_not_used(
    tmp_path: Path, kept: Callable[[], list[bool]]
) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / "neurosnap").symlink_to(tmp_path / "elsewhere")
    assert kept() == [False, False]


def test_it_is_compiled_once_it_was_interpreted_for_long_enough(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = iter(range(100))
    timer = SimpleNamespace(perf_counter=lambda: next(clock))
    monkeypatch.setattr(compiled_code, "time", timer)
    monkeypatch.setattr(
        compiled_code._Kernel, "dispatcher", lambda _: lambda: "compiled"
    )
    monkeypatch.setattr(compiled_code._Kernel, "is_kept", False)
    inner = njit(plain=lambda: "plain")(lambda: "slow")
    outer = njit()(inner)
    with interpreted(2.0):
        # An outer call takes a second, those within it count as part of it.
        assert [outer(), outer(), inner()] == ["plain", "plain", "compiled"]
    with interpreted(0.0), interpreted(2.0):
        assert inner() == "compiled"
    assert inner() == "compiled"
    monkeypatch.setattr(compiled_code._Kernel, "is_kept", True)
    with interpreted(2.0):
        assert inner() == "compiled"
    with interpreted(math.inf):
        assert inner() == "plain"


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
        found.append(start(program, **cache).splitlines())
    told = ["compiling for this machine, once: about 20 s"]
    assert found == [["13", *told], ["21", *told], ["31", *told], ["13"]]


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
    assert said.startswith("False 5 True\n")
