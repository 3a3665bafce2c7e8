"""The documentation site is whole, and asks no other host for anything."""

import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tools.site.__main__ import built
from tools.site.built_pages import faults

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
    assert list(faults(site)) == []
    for name in named(NAV):
        page = (site / name).with_suffix(".html").read_text()
        assert "default-src 'self'" in page, name


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            '<script src="https://example.org/b.js"></script>',
            "a.html: fetched from elsewhere: https://example.org/b.js",
        ),
        (
            '<link rel="stylesheet" href="//example.org/b.css">',
            "a.html: fetched from elsewhere: //example.org/b.css",
        ),
        (
            "<style>p { background: url('https://example.org/b') }</style>",
            "a.html: fetched from elsewhere: https://example.org/b",
        ),
    ],
)
def test_a_fault_of_a_page_is_named(tmp_path: Path, text: str, fault: str) -> None:
    own = '<a href="https://example.org">b</a><img src="b.png">'
    (tmp_path / "a.html").write_text(own + text)
    assert list(faults(tmp_path)) == [fault]


def test_a_style_sheet_that_asks_another_host_is_a_fault(tmp_path: Path) -> None:
    (tmp_path / "a.css").write_text('@import "https://example.org/b.css";')
    assert list(faults(tmp_path)) == [
        "a.css: fetched from elsewhere: https://example.org/b.css"
    ]
