"""The documentation site is whole, and asks no other host for anything."""

import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tools.site.__main__ import built

ROOT = Path(__file__).parents[2]
NAV = tomllib.loads((ROOT / "zensical.toml").read_text())["project"]["nav"]


def copied(folder: Path) -> Path:
    """Copy what the site is made of."""
    for name in ("docs", "neurosnap", "tools/site"):
        shutil.copytree(
            ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "zensical.toml", folder)
    return folder


def named(nav: Any) -> Iterator[str]:
    """Yield the pages of a part of the navigation."""
    match nav:
        case str():
            yield nav
        case dict():
            for part in nav.values():
                yield from named(part)
        case list():
            for part in nav:
                yield from named(part)


def test_every_page_is_in_the_navigation_once() -> None:
    docs = ROOT / "docs"
    pages = [str(path.relative_to(docs)) for path in docs.rglob("*.md")]
    assert sorted(named(NAV)) == sorted(pages)


@pytest.mark.slow
@pytest.mark.exhaustive
def test_the_site_is_whole_and_asks_no_other_host(tmp_path: Path) -> None:
    copied(tmp_path)
    assert built(tmp_path) == []
    site = tmp_path / "build/site"
    for name in named(NAV):
        page = (site / name).with_suffix(".html").read_text()
        assert "default-src 'self'" in page, name
