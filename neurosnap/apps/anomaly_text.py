"""An anomaly in a line of text."""

from collections.abc import Sequence

from neurosnap.protocol.anomaly_messages import Told
from neurosnap.sensorium import visible

_NAMES = 8  # names in one line about an anomaly; all of them are in `watch --json`


def anomaly_line(told: Told) -> str:
    """Return an anomaly as one line that names a few of what it is about."""
    long = f", since tick {told.since}" if told.since < told.tick else ""
    exact = "" if told.exact else " (at least)"
    likely = few(told.culprits) or "nobody"
    others = [name for name in told.candidates if name not in told.culprits]
    perhaps = f" or {few(others)}" if others else ""
    links = [
        f"{link.implication} ({link.support:g} for, {link.against:g} against,"
        f" since tick {link.since})"
        for link in told.broken
    ]
    broken = few(links, "; ", told.more)
    return visible(
        f"tick {told.tick}{long}: {likely}{perhaps}{exact} may be wrong:"
        f" breaks {broken}"
    )


def few(names: Sequence[str], comma: str = ", ", more: int = 0) -> str:
    """Return the first eight names, and how many others there are.

    Args:
        names: What to name.
        comma: What stands between two.
        more: How many there are beyond `names`.
    """
    more += max(0, len(names) - _NAMES)
    rest = f" and {more} more" if more else ""
    return comma.join(names[:_NAMES]) + rest
