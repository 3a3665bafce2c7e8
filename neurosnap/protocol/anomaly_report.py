"""Describes anomalies in words, leaving out rules with too little evidence."""

from collections.abc import Sequence

import msgspec

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.sensorium import visible


def with_support(anomaly: wire.Anomaly, support: int) -> wire.Anomaly | None:
    """Return an anomaly without the implications that rest on too few occasions.

    A broken implication rests on the occasions of the least of its links.

    Args:
        anomaly: As it came. One whose occasions were not counted stays as it is.
        support: The fewest occasions.

    Returns:
        None if nothing is left. Else only sensors that are in what is left may be
        wrong: they suffice to explain it, though fewer might.
    """
    if not support or any(link.occasions < 0 for link in anomaly.links):
        return anomaly
    least: dict[int, int] = {}
    for link in anomaly.links:
        least[link.number] = min(link.occasions, least.get(link.number, link.occasions))
    left = {number for number, held in least.items() if held >= support}
    if not left:
        return None
    if len(left) == len(least):
        return anomaly
    links = tuple(link for link in anomaly.links if link.number in left)
    about = {literal >> 1 for link in links for literal in (link.source, link.target)}
    return msgspec.structs.replace(
        anomaly,
        culprits=tuple(each for each in anomaly.culprits if each in about),
        candidates=tuple(each for each in anomaly.candidates if each in about),
        implications=len(left),  # those behind the ones listed rest on even less
        links=links,
    )


class Link(msgspec.Struct, frozen=True):
    """One learned implication among those an observation breaks."""

    implication: str
    """``door -> motion*``."""
    support: float
    """What was learned of both at once: a count, or a share."""
    against: float
    """What was learned of the first without the second, in the same units."""
    since: int
    """The tick since which it is believed."""
    occasions: int | None = None
    """On how many occasions it was put to the test before, and held; None if that was
    not counted."""


class NamedAnomaly(msgspec.Struct, frozen=True):
    """An anomaly in words."""

    tick: int
    since: int
    culprits: tuple[str, ...]
    candidates: tuple[str, ...]
    exact: bool
    broken: tuple[Link, ...]
    more: int
    """Broken implications beyond those listed."""


def named_anomaly(anomaly: wire.Anomaly, sensors: Sequence[str]) -> NamedAnomaly:
    """Return an anomaly with names in place of numbers; its support is not checked.

    Raises:
        MessageError: It is no anomaly of such sensors.
    """
    named = (
        *(2 * sensor for sensor in (*anomaly.culprits, *anomaly.candidates)),
        *(a for link in anomaly.links for a in (link.source, link.target)),
    )
    if max(named, default=0) >= 2 * len(sensors):
        raise MessageError(f"anomaly: must be of {len(sensors)} sensors, got another")

    def name(literal: int) -> str:
        return sensors[literal >> 1] + "*" * (literal & 1)

    return NamedAnomaly(
        tick=anomaly.tick,
        since=anomaly.since,
        culprits=tuple(sensors[each] for each in anomaly.culprits),
        candidates=tuple(sensors[each] for each in anomaly.candidates),
        exact=anomaly.exact,
        broken=tuple(
            Link(
                implication=f"{name(link.source)} -> {name(link.target)}",
                support=link.support,
                against=link.against,
                since=link.since,
                occasions=None if link.occasions < 0 else link.occasions,
            )
            for link in anomaly.links
        ),
        more=max(0, anomaly.implications - len({one.number for one in anomaly.links})),
    )


_NAMES, _LINKS = 8, 3
"""Names and implications in one line about an anomaly; `watch --json` has more."""


def anomaly_line(told: NamedAnomaly) -> str:
    """Return an anomaly as one line that names a few of what it is about."""
    long = f", since tick {told.since}" if told.since < told.tick else ""
    exact = "" if told.exact else " (at least)"
    likely = few(told.culprits) or "no sensor"
    others = [name for name in told.candidates if name not in told.culprits]
    perhaps = f" or {few(others)}" if others else ""
    shown = [f"{link.implication} ({evidence(link)})" for link in told.broken[:_LINKS]]
    broken = few(shown, "; ", told.more + len(told.broken) - len(shown))
    return visible(
        f"tick {told.tick}{long}: {likely}{perhaps}{exact} may be wrong:"
        f" breaks {broken}"
    )


def evidence(link: Link) -> str:
    """Return the evidence for and against a broken implication, in words."""
    on = "" if link.occasions is None else f" on {link.occasions} occasions"
    return (
        f"{link.support:g} for{on}, {link.against:g} against, since tick {link.since}"
    )


def few(names: Sequence[str], comma: str = ", ", more: int = 0) -> str:
    """Return the first eight names, and how many there are besides, `more` included."""
    more += max(0, len(names) - _NAMES)
    rest = f" and {more} more" if more else ""
    return comma.join(names[:_NAMES]) + rest
