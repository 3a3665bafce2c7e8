from pathlib import Path

import pytest

from neurosnap.apps.viewer.address import Address, keep_address, kept_address

ADDRESS = Address(8123, "t" * 32)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "neurosnap"


def test_an_address_is_kept_where_nobody_else_may_look(folder: Path) -> None:
    assert kept_address() is None
    keep_address(ADDRESS)
    assert kept_address() == ADDRESS
    assert folder.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize(
    "text", ["", "{}", '{"port": 0, "token": "x"}', '{"port": 70000, "token": "%s"}']
)
def test_what_is_no_address_is_not_used(folder: Path, text: str) -> None:
    keep_address(ADDRESS)
    (folder / "page.json").write_text(text.replace("%s", "t" * 32), encoding="utf-8")
    assert kept_address() is None


def test_a_folder_that_others_may_enter_keeps_nothing(folder: Path) -> None:
    folder.mkdir(mode=0o755)
    folder.chmod(0o755)
    keep_address(ADDRESS)
    assert list(folder.iterdir()) == []
    assert kept_address() is None
