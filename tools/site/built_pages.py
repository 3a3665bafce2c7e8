"""Faults of a built site: dead links, and what other hosts are asked for."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_FETCHED = {"src", "srcset", "poster", "data"}
_LOADS = {"stylesheet", "icon", "preload", "modulepreload", "preconnect", "manifest"}
_IN_STYLE = re.compile(r"""(?:url\(|@import)\s*["']?((?:https?:)?//[^"')\s]+)""")


class Page(HTMLParser):
    """What a page can be linked by, leads to, and loads.

    Attributes:
        names: The anchors in it.
        links: Where its links lead, as written.
        loads: What a browser fetches to show it, as written.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = _IN_STYLE.findall(text)
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag names, leads to, and loads."""
        given = {name: value for name, value in attrs if value}
        self.names |= {given[name] for name in ("id", "name") if name in given}
        self.loads += [given[name] for name in _FETCHED if name in given]
        if target := given.get("href"):
            loads = tag == "link" and _LOADS & set(given.get("rel", "").split())
            (self.loads if loads else self.links).append(target)


def faults(site: Path) -> Iterator[str]:
    """Yield what is wrong with a built site, a line for each fault.

    Args:
        site: The folder that the site was built into.
    """
    pages = {
        path.resolve(): Page(path.read_text(encoding="utf-8"))
        for path in sorted(site.rglob("*.html"))
    }
    for path, page in pages.items():
        name = path.relative_to(site.resolve())
        for target in page.loads:
            if _elsewhere(target):
                yield f"{name}: fetched from elsewhere: {target}"
        for target in dict.fromkeys(page.links + page.loads):
            fault = "" if _elsewhere(target) else _dead(site, path, target, pages)
            if fault:
                yield f"{name}: {fault}: {target}"
    for path in sorted(site.rglob("*.css")):
        for target in _IN_STYLE.findall(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(site)}: fetched from elsewhere: {target}"


def _elsewhere(target: str) -> bool:
    """Return whether an address is outside the site, and not in the page itself."""
    parts = urlsplit(target)
    return bool(parts.netloc) or parts.scheme not in ("", "data")


def _dead(site: Path, path: Path, target: str, pages: dict[Path, Page]) -> str:
    """Return why a link within the site leads nowhere; empty: it leads somewhere."""
    parts = urlsplit(target)
    if parts.scheme == "data":
        return ""
    # The page for what is not found is shown anywhere, and links from the root.
    start = site if parts.path.startswith("/") else path.parent
    way = unquote(parts.path).lstrip("/")
    to = (start / way).resolve() if parts.path else path
    if to.is_dir():
        to /= "index.html"
    if not to.is_file():
        return "no such page"
    anchor = unquote(parts.fragment)
    if anchor and to in pages and anchor not in pages[to].names:
        return "no such anchor"
    return ""
