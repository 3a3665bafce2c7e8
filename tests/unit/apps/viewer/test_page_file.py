"""The page as one file: its script, its security policy, and runs too large for it."""

import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

import pytest

from neurosnap.apps.viewer import page_file
from neurosnap.apps.viewer.page_file import write_page
from neurosnap.errors import InvalidValueError
from tests.support.recorded_runs import TICKS, path_run, recorded


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("page") / "run.mcap")


@pytest.mark.parametrize(
    ("limit", "most", "text"),
    [
        ("MOST_TICKS", TICKS - 1, f"run.mcap: must have 1 to {TICKS - 1} ticks to be"),
        ("MOST_BYTES", 60_000, "out: must be at most 0 MB (neurosnap view shows"),
    ],
)
def test_what_is_too_large_is_refused_and_leaves_nothing(
    limit: str,
    most: int,
    text: str,
    log: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(page_file, limit, most)
    with pytest.raises(InvalidValueError, match=rf"{re.escape(text)}.*{TICKS}"):
        write_page(log, tmp_path / "a.html")
    assert list(tmp_path.iterdir()) == []


def test_the_policy_lets_in_what_has_its_hash_and_no_network(
    log: Path, tmp_path: Path
) -> None:
    write_page(log, tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text()
    assert len(page) < 1_000_000
    (policy,) = re.findall(r'Content-Security-Policy" content="(.*?)"', page)
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert not re.findall(r"unsafe|http|blob|\*|self", policy)
    assert not re.findall(r"<link|<script src|url\((?!\"#)", page)
    inline = re.findall(
        r"<style>(.*?)</style>|module\">(.*?)</script>", page, re.DOTALL
    )
    for style, script in inline:
        digest = sha256((style or script).encode()).digest()
        assert f"'sha256-{b64encode(digest).decode()}'" in policy
    assert len(inline) == 2
