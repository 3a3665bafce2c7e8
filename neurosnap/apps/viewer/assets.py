"""Static files of the page; no other file is served."""

from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from starlette.responses import Response

PAGE = "index.html"
_TYPES = {
    "css": "text/css",
    "html": "text/html",
    "js": "text/javascript",
    "svg": "image/svg+xml",
}
_STATIC = files("neurosnap.apps.viewer") / "static"


def _found(folder: Traversable, prefix: str = "") -> Iterator[tuple[str, Traversable]]:
    """Yield the files of the page in a folder, with their names below ``static/``."""
    for entry in folder.iterdir():
        name = prefix + entry.name
        if entry.is_dir():
            yield from _found(entry, f"{name}/")
        elif name.rpartition(".")[2] in _TYPES:
            yield name, entry


_FILES = dict(sorted(_found(_STATIC)))
NAMES = tuple(_FILES)
"""All there are; a file that is not here is not there."""


def asset(name: str) -> Response | None:
    """Return the file of a name, ``""`` for the page itself; None: there is none."""
    known = name or PAGE
    if known not in _FILES:
        return None
    return Response(_content(known), media_type=_TYPES[known.rpartition(".")[2]])


@cache
def _content(name: str) -> bytes:
    """Return what is in one of `NAMES`."""
    return _FILES[name].read_bytes()
