"""The documentation site is complete, and loads nothing from other hosts."""

import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Route

from tools.browser import NO_BROWSER, browsing, chromium

ROOT = Path(__file__).parents[2]
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
@pytest.mark.parametrize("served", [True, False], ids=["served", "from a folder"])
async def test_its_own_files_are_enough(site: Path, *, served: bool) -> None:
    base = "https://site.test" if served else site.as_uri()
    wrong: list[str] = []

    async def answer(route: Route) -> None:
        """Answer from the files of the site, and nothing else."""
        file = site / route.request.url.removeprefix(base).partition("?")[0].lstrip("/")
        if not route.request.url.startswith(base) or not file.is_file():
            wrong.append(route.request.url)
            await route.abort()
            return
        await route.fulfill(path=file)

    async with browsing() as page:
        page.on("console", lambda m: wrong.extend([m.text] * (m.type != "info")))
        await page.context.route("**/*", answer)
        await page.goto(f"{base}/reference/python/orders.html")
        for opens in "/", "s":
            await page.goto(f"{base}/explanation/ideas.html")
            await page.keyboard.type("broke, p.")
            assert page.url == f"{base}/explanation/ideas.html"
            await page.keyboard.press(opens)
            await page.get_by_role("combobox", name="Search").fill("contrapositive")
            found = page.get_by_role("listbox").locator("mark, em, b, u, a")
            await found.filter(has_text="contrapositive").first.wait_for()
        await page.keyboard.press("ArrowDown")
        await page.keyboard.press("Enter")
        await page.wait_for_url("**?h=contrapositive*")
        await page.goto(f"{base}/viewing.html")
        await page.get_by_role("button", name="A wave on its way").press("Enter")
        await page.get_by_role("dialog").get_by_alt_text("A wave on its way").click()
        await page.goto(f"{base}/{'404' if served else 'index'}.html")
    assert wrong == []
