"""Converts moments to the local time of a time zone."""

import functools
import logging
import os
from datetime import UTC, datetime, tzinfo
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from neurosnap.errors import InvalidValueError

LOCALTIME = Path("/etc/localtime")
_logger = logging.getLogger(__name__)


def check_zone(name: str) -> None:
    """Raise InvalidValueError for a time zone that this machine does not know."""
    try:
        ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        rule = 'must be a time zone that this machine knows, such as "Europe/Berlin"'
        raise InvalidValueError("zone", rule, name) from None


def system_zone() -> str:
    """Return the name of this machine's time zone; UTC if it does not say."""
    named = os.environ.get("TZ", "").removeprefix(":")
    if not named and LOCALTIME.is_symlink():
        named = str(LOCALTIME.readlink()).rpartition("zoneinfo/")[2]
    try:
        check_zone(named)
    except InvalidValueError:
        return "UTC"
    return named


@functools.lru_cache(maxsize=16)
def _clock(zone: str) -> tzinfo:
    try:
        check_zone(zone)
    except InvalidValueError as error:  # of a recording that was made elsewhere
        _logger.warning("%s; times are in UTC", error)
        return UTC
    return ZoneInfo(zone)


def local(seconds: float, zone: str) -> datetime:
    """Return a moment by the clock of a zone; of one that is not known here, UTC's.

    Args:
        seconds: Since 1970.
        zone: Such as ``Europe/Berlin``.
    """
    return datetime.fromtimestamp(seconds, _clock(zone))


def dated(seconds: float, zone: str) -> str:
    """Return a moment as people are shown it; arguments as above."""
    return f"{local(seconds, zone):%a %d %b %Y %T %Z}"
