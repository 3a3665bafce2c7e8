"""Describes an option of a run: its help, unit, range and default in words.

An option is declared once, as the annotation of a field. The command line, the TOML
tables, their JSON Schema and the pages about them are made from it.
"""

from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import msgspec


class Shown(NamedTuple):
    """The help, unit, range and default of an option as users see them."""

    text: str
    """Its help."""
    at: str = ""
    """Its key in the TOML file; empty: its struct is a table of that file."""
    flag: str = ""
    """Its name on the command line, with underscores; empty: `--set` alone reaches
    it."""
    unit: str = ""
    """What stands for its value in the help, such as SECONDS; empty: its type."""
    default: str = ""
    """Its default in words, where a value does not tell; empty: the value."""


def option(
    text: str,
    *,
    at: str = "",
    flag: str = "",
    unit: str = "",
    default: str = "",
    **bounds: float,
) -> msgspec.Meta:
    """Return the annotation of a field that is an option, with the fields of `Shown`.

    The text says when to use it, and what to put; other options are named there as
    their fields are. The bounds are those of `msgspec.Meta`: gt, ge, lt, le.

    Examples:
        >>> option("Where to record.", unit="FILE").description
        'Where to record.'
    """
    shown = Shown(text, at, flag, unit, default)
    given: dict[str, Any] = dict(bounds)
    return msgspec.Meta(description=text, extra={"shown": shown}, **given)


class Declared(NamedTuple):
    """An option as a struct's field declares it: type, default, text for users."""

    field: str
    hint: Any
    """The annotation of the field."""
    kind: Any
    """The type of its values."""
    default: Any
    shown: Shown


def declared(struct: type[msgspec.Struct]) -> list[Declared]:
    """Return the options that a struct declares, in order.

    Examples:
        >>> class Table(msgspec.Struct):
        ...     many: Annotated[int, option("How many.")] = 1
        >>> [(one.field, one.kind, one.shown.text) for one in declared(Table)]
        [('many', <class 'int'>, 'How many.')]
    """
    hints = get_type_hints(struct, include_extras=True)
    found = []
    for field in msgspec.structs.fields(struct):
        hint = hints[field.name]
        if (one := _shown(hint)) is not None:
            found.append(Declared(field.name, hint, *one[:1], field.default, one[1]))
    return found


def _shown(hint: Any) -> tuple[Any, Shown] | None:  # noqa: ANN401 - any annotation
    """Return the type of an option and how it is shown; None if it is no option."""
    if get_origin(hint) is Annotated:
        kind, *notes = get_args(hint)
        for note in notes:
            if isinstance(note, msgspec.Meta) and note.extra:
                return kind, note.extra["shown"]
        return None
    for one in get_args(hint):  # it may be left out
        if (found := _shown(one)) is not None:
            return found[0] | None, found[1]
    return None
