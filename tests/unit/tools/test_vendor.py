"""Vendored files equal those that `tools/vendor` fetched, byte for byte."""

import hashlib
import re
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[3]
_SCRIPT = (_ROOT / "tools" / "vendor").read_text(encoding="utf-8")
_TAKEN = re.findall(
    r"^take (\S+) (\S+) (\S+) \\\n +(\S+) \\\n +(.+)$", _SCRIPT, re.MULTILINE
)
homes = pytest.mark.parametrize("home", sorted({taken[0] for taken in _TAKEN}))


@homes
def test_every_file_is_as_it_was_published(home: str) -> None:
    folder = _ROOT / home
    lines = (folder / "sums").read_text(encoding="ascii").splitlines()
    pinned = {name.removeprefix("./"): digest for digest, name in map(str.split, lines)}
    present = {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "sums"
    }
    assert {n: hashlib.sha512(b).hexdigest() for n, b in present.items()} == pinned


@homes
def test_every_file_is_one_the_script_names_and_has_a_licence(home: str) -> None:
    named = {
        f"{package}/{name.rpartition('/')[2]}"
        for folder, package, _, _, names in _TAKEN
        if folder == home
        for name in names.split()
    }
    folder = _ROOT / home
    files = (path for path in folder.rglob("*") if path.is_file())
    present = {path.relative_to(folder).as_posix() for path in files} - {"sums"}
    assert present == named
    packages = {name.partition("/")[0] for name in named}
    assert {f"{package}/LICENSE" for package in packages} <= present
