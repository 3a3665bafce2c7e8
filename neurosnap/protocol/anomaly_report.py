"""Describes anomalies in words, leaving out rules with too little evidence."""

from collections.abc import Collection, Sequence
from typing import Any

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import MessageError
from neurosnap.sensorium import visible


def with_support(anomaly: wire.Anomaly, support: int) -> wire.Anomaly | None:
    """Return an anomaly without implications that are retired, or rest on too little.

    A broken implication rests on the occasions of the least of its links, and is
    retired once one of them is; the anomaly in which that happens is the last.

    Args:
        anomaly: As it came. One whose occasions were not counted stays as it is.
        support: The fewest occasions; 0: it stays as it is.

    Returns:
        None if nothing is left. Else only sensors that are in what is left may be
        wrong: they suffice to explain it, though fewer might.
    """
    if not support or any(link.occasions < 0 for link in anomaly.links):
        return anomaly
    least: dict[int, int] = {}
    for link in anomaly.links:
        held = 0 if 0 < link.retired < anomaly.tick else link.occasions
        least[link.number] = min(held, least.get(link.number, held))
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


def broken_rule(anomaly: wire.Anomaly) -> wire.WeighedLink | None:
    """Return the rule by which an anomaly is told, as one link; None if it has none.

    It is the first that is about the first culprit, or else the first of all. A rule
    that follows from several links rests on the weakest of them.
    """
    rules: dict[int, wire.WeighedLink] = {}
    for link in anomaly.links:
        begun = rules.get(link.number, link)
        rules[link.number] = msgspec.structs.replace(
            link,
            source=begun.source,
            against=max(begun.against, link.against),
            occasions=min(begun.occasions, link.occasions),
        )
    for rule in rules.values():
        if {rule.source >> 1, rule.target >> 1} & {*anomaly.culprits[:1]}:
            return rule
    return next(iter(rules.values()), None)


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
    sentence: str
    """What was read against which rule, and how often that was so before."""


def named_anomaly(anomaly: wire.Anomaly, body: Body) -> NamedAnomaly:
    """Return an anomaly with names in place of numbers; its support is not checked.

    Where a window may be wrong the sensors that it reads may be.

    Raises:
        MessageError: It is no anomaly of such sensors.
    """
    sensors = body.sensors
    named = (
        *(2 * sensor for sensor in (*anomaly.culprits, *anomaly.candidates)),
        *(a for link in anomaly.links for a in (link.source, link.target)),
    )
    if max(named, default=0) >= 2 * len(sensors):
        raise MessageError(f"anomaly: must be of {len(sensors)} sensors, got another")

    def wrong(several: Sequence[int]) -> tuple[str, ...]:
        read = (own for each in several for own in body.read_for(each))
        return tuple(dict.fromkeys(sensors[own] for own in read))

    def name(literal: int) -> str:
        return sensors[literal >> 1] + "*" * (literal & 1)

    return NamedAnomaly(
        tick=anomaly.tick,
        since=anomaly.since,
        culprits=wrong(anomaly.culprits),
        candidates=wrong(anomaly.candidates),
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
        sentence=_sentence(anomaly, sensors),
    )


def _sentence(anomaly: wire.Anomaly, sensors: Sequence[str]) -> str:
    """Return what was read against a rule, and how often that was so before.

    The first culprit comes first. It is the one sentence that people are told of an
    anomaly, wherever they look.
    """
    rule = broken_rule(anomaly)
    if rule is None:
        return "the readings contradict what was learned"
    read = [rule.source, rule.target ^ 1]
    if read[1] >> 1 in anomaly.culprits[:1]:
        read.reverse()
    numbers = {each.sensor: f" ({each.number:g})" for each in anomaly.numbers}
    both = [
        f"{sensors[one >> 1]} is {'off' if one & 1 else 'on'}{numbers.get(one >> 1, '')}"
        for one in read
    ]
    what = " while ".join(dict.fromkeys(both))  # a rule may say that one is never on
    often = f"only {_counted(round(rule.against), 'time')} before"
    if rule.against < 1:  # of a count, 0; else a share of all there was
        often = "seldom before" if rule.against > 0 else "never before"
    among = f" in {_counted(rule.occasions, 'occasion')}" if rule.occasions > 0 else ""
    if rule.occasions == 0:  # negative: it is not known
        among = "; the rule was never tested"
    more = anomaly.implications - 1
    others = f"; {_counted(more, 'more rule')} broken, too" if more > 0 else ""
    return f"{what}: {often}{among}{others}{_retired(anomaly, sensors)}"


def _retired(anomaly: wire.Anomaly, sensors: Sequence[str]) -> str:
    """Return whose rules are retired with an anomaly, and whose return."""
    gone, back, since = dict[str, None](), dict[str, None](), anomaly.tick
    for link in anomaly.links:
        pair = f"{sensors[link.source >> 1]} and {sensors[link.target >> 1]}"
        if link.retired == anomaly.tick:
            gone[pair], since = None, min(since, link.worn)
        elif link.worn and not link.retired:
            back[pair] = None
    words = f"; {_pairs(back)} had gone together again for long" if back else ""
    if gone:
        words += f"; since tick {since} {_pairs(gone)} no longer go together as they"
        words += (
            " did: drift, or a changed plant? Not told again before they do for long"
        )
    return words


def _pairs(names: Collection[str]) -> str:
    more = f" ({_counted(len(names) - 1, 'more pair')}, too)"
    return f"{next(iter(names))}{more if len(names) > 1 else ''}"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


_NAMES = 8
"""Names in one line about an anomaly; `watch --format json` has more."""


def anomaly_line(told: NamedAnomaly) -> str:
    """Return an anomaly as one line, with the sensors that may be wrong instead."""
    long = f", since tick {told.since}" if told.since < told.tick else ""
    line = f"tick {told.tick}{long}: {told.sentence}"
    if told.exact and told.candidates == told.culprits[:1]:
        return visible(line)  # it begins with the only one
    exact = "" if told.exact else " (at least)"
    likely = few(told.culprits) or "no sensor"
    others = [name for name in told.candidates if name not in told.culprits]
    perhaps = f" or {few(others)}" if others else ""
    return visible(f"{line}; {likely}{perhaps}{exact} may be wrong")


def anomaly_record(told: NamedAnomaly) -> dict[str, Any]:
    """Return an anomaly as JSON can hold it, with its line as `text`."""
    return {**msgspec.to_builtins(told), "text": anomaly_line(told)}


def few(names: Sequence[str]) -> str:
    """Return the first eight names, and how many there are besides."""
    more = len(names) - _NAMES
    return ", ".join(names[:_NAMES]) + (f" and {more} more" if more > 0 else "")
