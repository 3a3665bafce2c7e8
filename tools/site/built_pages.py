"""What the pages of a built site ask other hosts for: nothing, if all is well."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlsplit

_FETCHED = {"src", "srcset", "poster", "data"}
_LOADS = {"stylesheet", "icon", "preload", "modulepreload", "preconnect", "manifest"}
_IN_STYLE = re.compile(r"""(?:url\(|@import)\s*["']?((?:https?:)?//[^"')\s]+)""")


class _Page(HTMLParser):
    """A page; `loads` is what a browser fetches to show it, as written."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = _IN_STYLE.findall(text)
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag loads."""
        given = {name: value for name, value in attrs if value}
        self.loads += [given[name] for name in _FETCHED if name in given]
        if tag == "link" and _LOADS & set(given.get("rel", "").split()):
            self.loads.append(given.get("href", ""))


def faults(site: Path) -> Iterator[str]:
    """Yield a line for each thing that is fetched from elsewhere.

    Args:
        site: The folder that the site was built into.
    """
    for path in sorted(site.rglob("*")):
        if path.suffix not in (".html", ".css"):
            continue
        text = path.read_text(encoding="utf-8")
        loads = _Page(text).loads if path.suffix == ".html" else _IN_STYLE.findall(text)
        for target in loads:
            parts = urlsplit(target)
            if parts.netloc or parts.scheme not in ("", "data"):
                yield f"{path.relative_to(site)}: fetched from elsewhere: {target}"
