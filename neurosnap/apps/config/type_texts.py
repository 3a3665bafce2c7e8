"""Human-readable texts of type constraints."""

import math
import re
from collections.abc import Iterable

from msgspec import inspect


def rule_of(kind: inspect.Type, value: object) -> str | None:
    """Return the rule that a single value breaks; None if it keeps it.

    Args:
        kind: What it should be. A kind that is not a number, a text, a truth value or
            a choice of these has no rule here.
        value: What it is, as TOML has it.
    """
    match kind:
        case inspect.Metadata():
            return rule_of(kind.type, value)
        case inspect.BoolType() if isinstance(value, bool):
            return None
        # True is 1 to Python, and not to anybody who writes a file.
        case inspect.IntType() if isinstance(value, int) and not isinstance(
            value, bool
        ):
            return None if _within(kind, value) else f"must be {_bounds(kind)}"
        case inspect.FloatType() if isinstance(value, int | float) and not isinstance(
            value, bool
        ):
            # JSON, and so a recording, has no word for what is not finite.
            good = _is_finite(value) and _within(kind, value)
            return None if good else f"must be {_bounds(kind) or 'finite'}"
        case inspect.StrType() if isinstance(value, str):
            return _rule_of_text(kind, value)
        case inspect.LiteralType():
            known = any(
                value == one and type(value) is type(one) for one in kind.values
            )
            return None if known else f"must be {name_of(kind)}"
        case (
            inspect.BoolType()
            | inspect.IntType()
            | inspect.FloatType()
            | inspect.StrType()
        ):
            return f"must be {name_of(kind)}"
        case _:
            return None


def name_of(kind: inspect.Type) -> str:
    """Return what something should be, in a few words."""
    match kind:
        case inspect.Metadata():
            return name_of(kind.type)
        case inspect.BoolType():
            return "true or false"
        case inspect.IntType():
            return "a whole number" + _also(_bounds(kind))
        case inspect.FloatType():
            return "a number" + _also(_bounds(kind))
        case inspect.StrType():
            return "text"
        case inspect.LiteralType():
            return either(map(repr, kind.values))
        case inspect.ListType() | inspect.VarTupleType():
            return "a list"
        case _:
            return "a table"


def either(words: Iterable[str]) -> str:
    """Return a choice in words.

    Example:
        >>> either(["a", "b", "c"])
        'a, b or c'
    """
    *most, last = words
    return f"{', '.join(most)} or {last}" if most else last


def _rule_of_text(kind: inspect.StrType, value: str) -> str | None:
    if len(value) < (kind.min_length or 0):
        return f"must have {kind.min_length} or more characters"
    if kind.max_length is not None and len(value) > kind.max_length:
        return f"must have at most {kind.max_length} characters"
    if kind.pattern is not None and not re.search(kind.pattern, value):
        return f"must match {kind.pattern}"
    return None


def _within(kind: inspect.IntType | inspect.FloatType, value: float) -> bool:
    return (
        (kind.gt is None or value > kind.gt)
        and (kind.ge is None or value >= kind.ge)
        and (kind.lt is None or value < kind.lt)
        and (kind.le is None or value <= kind.le)
    )


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond every float
        return False


def _bounds(kind: inspect.IntType | inspect.FloatType) -> str:
    """Return the range in words; empty: there is none."""
    low = kind.ge if kind.gt is None else kind.gt
    high = kind.le if kind.lt is None else kind.lt
    if low is not None and high is not None:
        left, right = "[" if kind.gt is None else "(", "]" if kind.lt is None else ")"
        return f"in {left}{low}, {high}{right}"
    finite = " and finite" if isinstance(kind, inspect.FloatType) else ""
    if low is not None:
        return (f"{low} or more" if kind.gt is None else f"more than {low}") + finite
    if high is not None:
        return (f"at most {high}" if kind.lt is None else f"less than {high}") + finite
    return ""


def _also(bounds: str) -> str:
    """Return a range as it follows what has it."""
    return f" {bounds}" if bounds.startswith("in ") else bounds and f", {bounds}"
