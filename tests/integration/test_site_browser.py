"""The documentation site in a real browser: it is searched, and asks no other host."""

import mimetypes
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.async_api import ConsoleMessage, Route

from tests.integration.test_site import copied
from tools.browser import NO_BROWSER, browsing, chromium
from tools.site.__main__ import built

pytestmark = [
    pytest.mark.slow,
    pytest.mark.exhaustive,
    pytest.mark.skipif(chromium() is None, reason=NO_BROWSER),
]

HOST = "site.test"


async def test_it_is_read_and_searched_from_its_own_files(tmp_path: Path) -> None:
    assert built(copied(tmp_path)) == []
    site = tmp_path / "build/site"
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
