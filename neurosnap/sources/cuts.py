"""Chooses the sensors that a signal of numbers or words is cut into.

What reads 0 and 1, or words for them, is a sensor as it is. A number gives sensors that
say whether it is above its quartiles, and a signal of few words one for each word. The
choice is made of the values that are learned from, and goes with the run, so that a run
stays a function of its observations.

Sensors of one signal imply each other whatever happens: above 60 is above 40. That is
known, and nothing that was learned.
"""

import logging
import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, combinations, product

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import WORDS
from neurosnap.sources.conditions import (
    Change,
    Choice,
    Comparison,
    Condition,
    Heard,
    Signals,
    parse_condition,
)
from neurosnap.sources.meaning import as_text
from neurosnap.sources.wanted import Wanted

WORDS_AT_MOST = 8
"""Different words of a signal that is cut into one sensor a word."""
_logger = logging.getLogger(__name__)
_NAMED = 8  # signals that are left out
_COUNTER = 64  # numbers, ever larger, of which none is a signal
_KEPT = 4096  # values of a signal that are kept, evenly spread


def with_cuts(
    wanted: Wanted, values: Iterable[tuple[str, object, bool]], *, lenient: bool = False
) -> Wanted:
    """Return what is wanted with the cuts of the signals that need some.

    Args:
        wanted: Returned as it is where its cuts are chosen already.
        values: What each signal that is taken says, in any order: its name, a text or
            another JSON value, and whether its numbers are learned from.
        lenient: Leave out what is no sensor and cannot be cut, such as free text; else
            it is left to be refused, where it stands.
    """
    if wanted.cuts is not None or not wanted.bins:
        return wanted
    return cut_by(wanted, signals_in(values), lenient=lenient)


def cut_by(wanted: Wanted, signals: Mapping[str, "Signal"], *, lenient: bool) -> Wanted:
    """Return what is wanted with cuts, by what each signal says; see `with_cuts`."""
    cuts = {
        name: tuple(signal.cuts(name, wanted.bins)) if wanted.bins else ()
        for name, signal in signals.items()
        if signal.is_cut or (lenient and not signal.is_plain)
    }
    # Of some it was said how to read them, and of the others nothing.
    if wanted.conditions and not wanted.patterns:
        cuts = dict.fromkeys(cuts, ())
    if left := [name for name, some in cuts.items() if not some]:
        more = f" and {len(left) - _NAMED} more" if len(left) > _NAMED else ""
        _logger.warning(
            "left out, as they only grow, are text, always the same or not asked for"
            " (--when reads them): %s%s",
            ", ".join(left[:_NAMED]),
            more,
        )
    return replace(wanted, cuts=cuts)


def signals_in(values: Iterable[tuple[str, object, bool]]) -> dict[str, "Signal"]:
    """Return what each signal says, by its name; see `with_cuts`."""
    signals: dict[str, Signal] = {}
    for name, value, learned in values:
        signal = signals.get(name)
        if signal is None:
            signal = signals[name] = Signal()
        if value not in signal.seen:
            signal.add(value, learned=learned)
    return signals


class Signal:
    """What one signal has said: a few of its words, and an even sample of its numbers.

    Attributes:
        seen: Values of which nothing more is to be learned, for speed.
    """

    def __init__(self) -> None:
        self.seen: set[object] = set()
        self._words: set[str] = set()
        self._numbers: list[float] = []
        self._step, self._count = 1, 0
        self._has_numbers, self._is_bit = False, True
        self._last, self._falls = -math.inf, False
        self._low, self._high = math.inf, -math.inf

    def add(self, value: object, *, learned: bool) -> None:
        """Take in what it said, and as a number if it is learned from.

        A text, or another JSON value. What is of a type of fractions is no bit, though
        it has only been 0 and 1 so far.
        """
        if type(value) is float and math.isfinite(value):
            self._is_bit, number = False, value
        else:
            word = (value if isinstance(value, str) else as_text(value)).strip()
            word = word.casefold()
            said = WORDS.get(word, math.nan)
            if said is None:
                self.seen.add(value)
                return
            if (found := _number(word)) is None:
                if len(self._words) <= WORDS_AT_MOST:
                    self._words.add(word)
                    self.seen.add(value)
                return
            number = found
        self._has_numbers, self._is_bit = True, self._is_bit and number in (0, 1)
        self._falls |= number < self._last
        self._last = number
        self._low, self._high = min(self._low, number), max(self._high, number)
        if not learned or math.isinf(number):
            return
        if self._count % self._step == 0:
            self._numbers.append(number)
            if len(self._numbers) == _KEPT:
                del self._numbers[1::2]
                self._step *= 2
        self._count += 1

    def says(self) -> str:
        """Return what it says in short: its words, its range, or that it is text."""
        words = sorted(self._words)
        if len(words) > WORDS_AT_MOST:
            return "text"
        if self._has_numbers:
            same = self._low == self._high
            words.append(f"{self._low:g}{'' if same else f' to {self._high:g}'}")
        return ", ".join(words) or "nothing"

    @property
    def is_plain(self) -> bool:
        """It says nothing but on, off and unknown."""
        return self._is_bit and all(word in WORDS for word in self._words)

    @property
    def is_cut(self) -> bool:
        """It says something else than on, off and unknown, and can be cut."""
        if not self._words:
            return not self._is_bit
        # What says on and off, and once something else, is not cut but refused.
        plain = self._has_numbers or not self._words.isdisjoint(WORDS)
        return not plain and len(self._words) <= WORDS_AT_MOST

    @property
    def _is_counter(self) -> bool:
        """It has only ever grown, as a clock does."""
        return not self._falls and len(set(self._numbers)) > _COUNTER

    def cuts(self, name: str, parts: int) -> Iterator[Condition]:
        """Yield its cuts, ascending; none if it says one thing only, or free text."""
        if not self.is_cut:
            return
        if len(self._words) > 1:
            yield from (Choice(name, word) for word in sorted(self._words))
        elif not self._words and not self._is_counter:
            for limit in _limits(sorted(self._numbers), parts):
                yield Comparison(name, True, limit)


def _number(word: str) -> float | None:
    """Return a number; None for anything else."""
    try:
        number = float(word)
    except ValueError:
        return None
    return None if math.isnan(number) else number


def _limits(values: Sequence[float], parts: int) -> Iterator[float]:
    """Yield limits between values that cut them into parts of about the same size.

    Each is the shortest number that parts the same values. Of few values all are parted
    from each other.
    """
    distinct = sorted(set(values))
    if len(distinct) <= parts:
        places = list(range(len(distinct) - 1))
    else:
        ranks = (len(values) * part // parts for part in range(1, parts))
        found = {bisect_right(distinct, values[rank]) - 1 for rank in ranks}
        places = sorted(found - {len(distinct) - 1})
    for place in places:
        low, high = distinct[place], distinct[place + 1]
        rounded = (
            float(f"{near:.{digits}g}")
            for digits in range(1, 18)
            for near in (low, low + (high - low) / 2)
        )
        yield next(limit for limit in rounded if low <= limit < high)


def known_order(
    sensors: Sequence[str], conditions: Mapping[str, Condition]
) -> Iterator[tuple[int, int]]:
    """Yield which literals imply which, whatever the signals say.

    Args:
        sensors: Their names.
        conditions: When they are on, by name.

    Returns:
        Pairs ``(a, b)`` of literals, ``a -> b``, with each its contrapositive. O(n²) of
        the sensors of one signal.
    """
    signals: dict[str, list[tuple[int, Condition]]] = {}
    for sensor, name in enumerate(sensors):
        if (condition := conditions.get(name)) is not None:
            signals.setdefault(condition.source, []).append((sensor, condition))
    for members in signals.values():
        for (i, a), (j, b) in combinations(members, 2):
            for p, q in product((0, 1), repeat=2):
                if _excludes(a, p, b, 1 - q):
                    yield 2 * i + p, 2 * j + q
                    yield 2 * j + 1 - q, 2 * i + 1 - p


_NEVER = (
    {("rises", 0), ("falls", 0)},
    *({(kind, 0), ("changes", 1)} for kind in ("rises", "falls")),
)
"""What never is at once; 1: it does not."""


def _excludes(a: Condition, p: int, b: Condition, q: int) -> bool:
    """Return whether two literals of a signal exclude each other; 1 is a complement."""
    match a, b:
        case Choice(), Choice():
            return a.word != b.word and p == q == 0
        case Change(), Change():
            return {(a.kind, p), (b.kind, q)} in _NEVER
        case Heard(), Heard():
            return p != q and (a.within <= b.within) == (q == 1)
        case Comparison(), Comparison():
            pass
        case _:
            return False
    (low, high), (least, most) = a.span(on=not p), b.span(on=not q)
    return low > most or least > high


def as_json(signals: Signals) -> str:
    """Return how signals are read, as it is recorded with a run."""
    texts = {n: [c and c.text for c in some] for n, some in signals.items()}
    return msgspec.json.encode(texts).decode()


def recorded_signals(text: str) -> Signals:
    """Return how signals are read, as `as_json` wrote it.

    Raises:
        InvalidValueError: It does not say so.
    """
    try:
        found = msgspec.json.decode(text, type=dict[str, list[str | None]])
    except msgspec.MsgspecError as error:
        rule = f"must be conditions by the names of signals ({error})"
        raise InvalidValueError("cuts", rule, text) from error
    return {
        name: tuple(parse_condition(each, name) if each else None for each in some)
        for name, some in found.items()
    }


def conditions_in(text: str) -> tuple[Condition, ...]:
    """Return the conditions in a text, semicolons between them.

    Raises:
        InvalidValueError: One is none.
    """
    return tuple(parse_condition(each) for each in text.split(";") if each.strip())


def recorded_conditions(arguments: Mapping[str, object]) -> dict[str, Condition]:
    """Return when sensors are on, by the arguments that a run has recorded.

    Raises:
        InvalidValueError: Its cuts or conditions are none.
    """
    found: list[Condition | None] = []
    for name in ("cuts", "signals"):
        if isinstance(text := arguments.get(name), str) and text:
            found += chain.from_iterable(recorded_signals(text).values())
    if isinstance(when := arguments.get("when"), str):
        found += conditions_in(when)
    return {each.name: each for each in found if each}
