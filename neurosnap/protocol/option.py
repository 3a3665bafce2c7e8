"""Describes an option of a run: its help, unit, range and default in words.

An option is declared once, as the annotation of a field. The command line, the TOML
tables and their JSON Schema are made from it.
"""

from typing import Annotated, Any, NamedTuple, get_args, get_origin

import msgspec


class Shown(NamedTuple):
    """How an option is shown to those who use it."""

    text: str
    """Its help."""
    flag: str = ""
    """Its name on the command line, with underscores; empty: that of the field."""
    unit: str = ""
    """What stands for its value in the help, such as SECONDS; empty: its type."""
    default: str = ""
    """Its default in words, where a value does not tell; empty: the value."""


def option(
    text: str,
    *,
    flag: str = "",
    unit: str = "",
    default: str = "",
    gt: float | None = None,
    ge: float | None = None,
    lt: float | None = None,
    le: float | None = None,
    min_length: int | None = None,
) -> msgspec.Meta:
    """Return the annotation of a field that is an option.

    Args:
        text: Its help: when to use it, and what to put. Other options are named as
            their fields are.
        flag: See `Shown`.
        unit: See `Shown`.
        default: See `Shown`.
        gt: Values are greater.
        ge: Values are greater or equal.
        lt: Values are less.
        le: Values are less or equal.
        min_length: The fewest characters of a text.

    Example:
        >>> option("Where to record.", unit="FILE").description
        'Where to record.'
    """
    bounds: dict[str, Any] = {
        "gt": gt,
        "ge": ge,
        "lt": lt,
        "le": le,
        "min_length": min_length,
    }
    given = {name: value for name, value in bounds.items() if value is not None}
    shown = Shown(text, flag, unit, default)
    return msgspec.Meta(description=text, extra={"shown": shown}, **given)


def declared(hint: Any) -> tuple[Any, Shown] | None:  # noqa: ANN401 - any annotation
    """Return the type of an option and how it is shown; None: it is no option.

    Args:
        hint: The annotation of its field; an option that may be left out may be None.

    Example:
        >>> kind, shown = declared(Annotated[int, option("How many.")] | None)
        >>> kind, shown.text
        (int | None, 'How many.')
    """
    if get_origin(hint) is Annotated:
        kind, *notes = get_args(hint)
        for note in notes:
            if isinstance(note, msgspec.Meta) and note.extra:
                return kind, note.extra["shown"]
        return None
    for one in get_args(hint):
        if (found := declared(one)) is not None:
            kind, shown = found
            return kind | None, shown
    return None
