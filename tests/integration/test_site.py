"""The documentation site is complete, and loads nothing from other hosts."""

import mimetypes
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.async_api import ConsoleMessage, Route

from tools.browser import NO_BROWSER, browsing, chromium

ROOT = Path(__file__).parents[2]
HOST = "site.test"
NAV = tomllib.loads((ROOT / "zensical.toml").read_text())["project"]["nav"]


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


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built without a warning from a copy of what it is made of."""
    folder = tmp_path_factory.mktemp("site")
    for name in ("docs", "neurosnap", "tools/site"):
        shutil.copytree(
            ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(ROOT / "zensical.toml", folder)
    command = [str(folder / "tools/site/build"), sys.executable]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout
    return folder / "build/site"


@pytest.mark.slow
@pytest.mark.exhaustive
def test_the_policy_of_each_page_names_no_other_host(site: Path) -> None:
    for name in named(NAV):
        page = (site / name).with_suffix(".html").read_text()
        assert "default-src 'self'" in page, name


@pytest.mark.slow
@pytest.mark.exhaustive
@pytest.mark.skipif(chromium() is None, reason=NO_BROWSER)
async def test_it_is_read_and_searched_from_its_own_files(site: Path) -> None:
    elsewhere: list[str] = []
    said: list[str] = []

    async def answer(route: Route) -> None:
        """Answer from the files of the site, and nothing else."""
        url = urlsplit(route.request.url)
        file = site / url.path.lstrip("/")
        if url.hostname != HOST or not file.is_file():
            elsewhere.append(route.request.url)
            await route.abort()
            return
        kind = mimetypes.guess_type(file.name)[0] or "application/octet-stream"
        await route.fulfill(body=file.read_bytes(), content_type=kind)

    def listen(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            said.append(message.text)

    async with browsing() as page:
        page.on("console", listen)
        await page.context.route("**/*", answer)
        for name in "index", "reference/python", "explanation/ideas":
            await page.goto(f"https://{HOST}/{name}.html")
        await page.get_by_role("button", name="Search").first.click()
        await page.keyboard.type("contrapositive")
        found = page.get_by_role("listbox").locator("mark, em, b, u, a")
        await found.filter(has_text="contrapositive").first.wait_for()
        await page.goto(f"https://{HOST}/404.html")
    assert elsewhere == []
    assert said == []
