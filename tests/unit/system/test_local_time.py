"""Times are given in a time zone, and in UTC if that zone is unknown here."""

from pathlib import Path

import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.system import local_time
from neurosnap.system.local_time import check_zone, local, system_zone


@pytest.mark.parametrize(
    ("zone", "told"),
    [
        ("Europe/Berlin", "2026-03-29 03:00:00 CEST"),
        ("Asia/Kolkata", "2026-03-29 06:30:00 IST"),
        ("Mars/Base", "2026-03-29 01:00:00 UTC"),
    ],
)
def test_a_moment_is_told_by_the_local_clock(zone: str, told: str) -> None:
    assert f"{local(1774746000, zone):%F %T %Z}" == told


@pytest.mark.parametrize("name", ["Mars/Base", "", "../etc/passwd", "/etc/localtime"])
def test_a_zone_that_is_not_known_is_refused(name: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^zone: must be a time zone that"):
        check_zone(name)


@pytest.mark.parametrize(
    ("named", "link", "zone"),
    [
        ("Asia/Kolkata", "/usr/share/zoneinfo/Europe/Berlin", "Asia/Kolkata"),
        (":Asia/Kolkata", None, "Asia/Kolkata"),
        ("", "/usr/share/zoneinfo/Europe/Berlin", "Europe/Berlin"),
        ("", "/usr/share/zoneinfo/Mars/Base", "UTC"),
        ("CET-1CEST", None, "UTC"),
        ("", None, "UTC"),
    ],
)
def test_a_machine_says_its_zone(
    named: str,
    link: str | None,
    zone: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TZ", named)
    place = tmp_path / "localtime"
    if link is not None:
        place.symlink_to(link)
    monkeypatch.setattr(local_time, "LOCALTIME", place)
    assert system_zone() == zone
