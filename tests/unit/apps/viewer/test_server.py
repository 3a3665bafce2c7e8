"""The server serves exactly the static files of the page."""

from pathlib import Path

import pytest

from neurosnap.apps import viewer
from neurosnap.apps.viewer.server import NAMES, asset

STATIC = Path(viewer.__file__).parent / "static"
UNSERVED = {"LICENSE", "sums"}
"""Files that come with what is vendored."""


def test_all_there_are_are_named() -> None:
    there = {
        path.relative_to(STATIC).as_posix()
        for path in STATIC.rglob("*")
        if path.is_file() and path.name not in UNSERVED
    }
    assert set(NAMES) == there
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_each_is_given_as_what_it_is(name: str) -> None:
    given = asset(name)
    assert given is not None
    assert given.body == (STATIC / name).read_bytes()
    kinds = {"js": "text/javascript", "css": "text/css", "html": "text/html"}
    kind = kinds.get(name.rpartition(".")[2], "image/svg+xml")
    assert given.headers["content-type"].split(";")[0] == kind


@pytest.mark.parametrize(
    "name",
    ["../server.py", "api.py", "./api.js", "vendor/", "vendor/sums", "/base/api.js"],
)
def test_nothing_else_is(name: str) -> None:
    assert asset(name) is None


def test_no_name_is_the_page() -> None:
    page, named = asset(""), asset("index.html")
    assert page is not None
    assert named is not None
    assert page.body == named.body
