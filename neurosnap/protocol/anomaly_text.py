"""An anomaly in a line of text."""

from collections.abc import Sequence

from neurosnap.protocol.anomaly_messages import Link, Told
from neurosnap.sensorium import visible

_NAMES, _LINKS = 8, 3
"""Names and implications in one line about an anomaly; `watch --json` has more."""


def anomaly_line(told: Told) -> str:
    """Return an anomaly as one line that names a few of what it is about."""
    long = f", since tick {told.since}" if told.since < told.tick else ""
    exact = "" if told.exact else " (at least)"
    likely = few(told.culprits) or "nobody"
    others = [name for name in told.candidates if name not in told.culprits]
    perhaps = f" or {few(others)}" if others else ""
    shown = [f"{link.implication} ({evidence(link)})" for link in told.broken[:_LINKS]]
    broken = few(shown, "; ", told.more + len(told.broken) - len(shown))
    return visible(
        f"tick {told.tick}{long}: {likely}{perhaps}{exact} may be wrong:"
        f" breaks {broken}"
    )


def evidence(link: Link) -> str:
    """Return what speaks for a broken implication, and against it."""
    on = "" if link.occasions is None else f" on {link.occasions} occasions"
    return (
        f"{link.support:g} for{on}, {link.against:g} against, since tick {link.since}"
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
