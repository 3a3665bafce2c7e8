"""Validates a TOML table and reports all problems at once.

`msgspec` says whether a value is what a struct asks for, stops at the first thing that
is wrong, and does not name the keys of a dictionary. So the walk over the structs is
done here, value by value, and `msgspec` has the last word on every table in which
nothing was found: what it would refuse is never let through.
"""

import functools
import math
import re
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import msgspec
from msgspec import UNSET, inspect

from neurosnap.apps.config.problems import Keys, dotted
from neurosnap.errors import InvalidValueError, either, similar


class Problem(NamedTuple):
    """One problem with a value of a table."""

    keys: Keys
    """The way to it."""
    rule: str
    """What it must be."""
    value: object
    """What it is; `UNSET`: it is missing, or it is a key that should not be there."""


def problems(table: object, kind: type[msgspec.Struct]) -> list[Problem]:
    """Return all that keeps a table from being a struct.

    Every value is judged alone, and every struct whose values are all right as a whole.

    Args:
        table: As TOML has it.
        kind: What it should be; of structs, lists of one kind, tables of one kind,
            texts, numbers, truth values and choices of these.

    Returns:
        None found: ``msgspec.convert(table, kind)`` raises nothing.
    """
    walk = _Walk(known_keys(kind))
    return list(walk.of(table, _type_info(kind), ()))


def known_keys(kind: type[msgspec.Struct]) -> list[Keys]:
    """Return the way to every key that a table of a kind may have, lists left out."""
    return list(dict.fromkeys(_keys_of(_type_info(kind), ())))


@functools.cache
def _type_info(kind: type[msgspec.Struct]) -> inspect.Type:
    """Do as `inspect.type_info`, once: it takes longer than to judge a table."""
    return inspect.type_info(kind)


class _Walk(NamedTuple):
    known: list[Keys]
    """The keys that exist anywhere, to find what a misplaced one was meant to be."""

    def of(self, value: object, kind: inspect.Type, at: Keys) -> Iterator[Problem]:
        match kind:
            case inspect.Metadata():  # an option's help
                yield from self.of(value, kind.type, at)
            case inspect.UnionType():
                yield from self._of_one(value, kind, at)
            case inspect.StructType():
                yield from self._of_struct(value, kind, at)
            case inspect.DictType():
                if not isinstance(value, dict):
                    yield Problem(at, "must be a table", value)
                    return
                for key, item in value.items():
                    yield from self.of(item, kind.value_type, (*at, key))
            case inspect.ListType() | inspect.VarTupleType():
                yield from self._of_list(value, kind, at)
            case _ if not _is_one(value, kind):
                yield Problem(at, f"must be {name_of(kind)}", value)

    def _of_one(
        self, value: object, kind: inspect.UnionType, at: Keys
    ) -> Iterator[Problem]:
        """Judge what may be of several kinds by the one that it is meant to be."""
        # TOML has no word for nothing, and what is left out is not looked at.
        kinds = [one for one in kind.types if not isinstance(one, inspect.NoneType)]
        structs = [one for one in kinds if isinstance(one, inspect.StructType)]
        if isinstance(value, dict) and len(structs) > 1:
            yield from self._of_tagged(value, structs, at)
            return
        found = [list(self.of(value, one, at)) for one in kinds]
        if [] in found:
            return
        # A list is right or wrong by what is in it, a number by its range.
        inner = [some for some in found if some[0].keys != at]
        if len(kinds) == 1 or inner:
            yield from (inner or found)[0]
        else:
            names = dict.fromkeys(map(name_of, kinds))
            yield Problem(at, f"must be {either(names)}", value)

    def _of_tagged(
        self,
        table: dict[str, Any],
        structs: list[inspect.StructType],
        at: Keys,
    ) -> Iterator[Problem]:
        tags = {struct.tag: struct for struct in structs}
        field = structs[0].tag_field or ""
        tag = table.get(field, UNSET)
        if isinstance(tag, str) and tag in tags:
            yield from self._of_struct(table, tags[tag], at)
            return
        for key in table if tag is UNSET else ():
            if asks := similar(key, [field]):
                yield Problem((*at, key), f"must be a known key{asks}", UNSET)
                return
        yield Problem((*at, field), f"must be {either(map(repr, tags))}", tag)

    def _of_struct(
        self, table: object, kind: inspect.StructType, at: Keys
    ) -> Iterator[Problem]:
        if not isinstance(table, dict):
            yield Problem(at, "must be a table", table)
            return
        fields = {field.encode_name: field for field in kind.fields}
        found: list[Problem] = []
        for key, value in table.items():
            if key in fields:
                found += self.of(value, fields[key].type, (*at, key))
            elif key != kind.tag_field:
                found.append(
                    Problem((*at, key), self._unknown((*at, key), fields), UNSET)
                )
        found += (
            Problem((*at, name), "must be given", UNSET)
            for name, field in fields.items()
            if field.required and name not in table
        )
        yield from found or _as_a_whole(table, kind, at)

    def _of_list(
        self,
        value: object,
        kind: inspect.ListType | inspect.VarTupleType,
        at: Keys,
    ) -> Iterator[Problem]:
        if not isinstance(value, list):
            yield Problem(at, "must be a list", value)
            return
        if len(value) < (kind.min_length or 0):
            yield Problem(at, f"must have {kind.min_length} or more items", value)
        for place, item in enumerate(value):
            yield from self.of(item, kind.item_type, (*at, place))

    def _unknown(self, at: Keys, fields: Iterable[str]) -> str:
        """Return what to say of a key that does not exist."""
        elsewhere = [
            dotted(keys) for keys in self.known if keys[-1] == at[-1] and keys != at
        ]
        asks = f" (did you mean {either(elsewhere)}?)" if elsewhere else ""
        likely = similar(at[-1], fields) or asks or f": {either(fields)}"
        return f"must be a known key{likely}"


def _as_a_whole(
    table: dict[str, Any], kind: inspect.StructType, at: Keys
) -> Iterator[Problem]:
    """Judge a table whose values are all right, each alone."""
    try:
        msgspec.convert(table, kind.cls)
    except msgspec.ValidationError as error:
        cause = error.__cause__
        if not isinstance(cause, InvalidValueError):
            yield Problem(at, str(error), UNSET)
            return
        # Who checks several values names one: the key, perhaps after a name.
        name = cause.name.rpartition(": ")[2]
        if name in table:
            yield Problem((*at, name), cause.rule, cause.value)
        else:
            yield Problem(at, str(cause), UNSET)


def _keys_of(kind: inspect.Type, at: Keys) -> Iterator[Keys]:
    match kind:
        case inspect.Metadata():
            yield from _keys_of(kind.type, at)
        case inspect.StructType():
            for field in kind.fields:
                yield (*at, field.encode_name)
                yield from _keys_of(field.type, (*at, field.encode_name))
        case inspect.UnionType():
            for one in kind.types:
                yield from _keys_of(one, at)
        case _:
            return


def _is_one(value: object, kind: inspect.Type) -> bool:
    """Return whether a single value, as TOML has it, is of a kind."""
    match kind:
        case inspect.BoolType():
            return isinstance(value, bool)
        case inspect.IntType() | inspect.FloatType():
            numbers = int if isinstance(kind, inspect.IntType) else int | float
            # True is 1 to Python, and not to anybody who writes a file.
            number = isinstance(value, numbers) and not isinstance(value, bool)
            return number and _within(kind, value)
        case inspect.StrType():
            low, high = kind.min_length or 0, kind.max_length or math.inf
            pattern = kind.pattern or ""
            return (
                isinstance(value, str)
                and low <= len(value) <= high
                and re.search(pattern, value) is not None
            )
        case inspect.LiteralType():
            return value in kind.values
        case _:
            return True


def name_of(kind: inspect.Type) -> str:
    """Return the name of an expected type, in a few words."""
    match kind:
        case inspect.Metadata():
            return name_of(kind.type)
        case inspect.BoolType():
            return "true or false"
        case inspect.IntType():
            return f"a whole number{_bounds(kind)}"
        case inspect.FloatType():
            bounds = _bounds(kind)
            return f"{'a' if bounds.startswith(' in') else 'a finite'} number{bounds}"
        case inspect.StrType(pattern=str(pattern)):
            return f"text that matches {pattern}"
        case inspect.StrType(max_length=int(most)):
            return f"text of {kind.min_length or 0} to {most} characters"
        case inspect.StrType():
            return "text, and not empty" if kind.min_length else "text"
        case inspect.LiteralType():
            return either(map(repr, kind.values))
        case inspect.ListType() | inspect.VarTupleType():
            return "a list"
        case _:
            return "a table"


def _within(kind: inspect.IntType | inspect.FloatType, value: Any) -> bool:  # noqa: ANN401
    try:
        # JSON, and so a recording, has no word for what is not finite.
        finite = isinstance(kind, inspect.IntType) or math.isfinite(value)
    except OverflowError:  # a whole number beyond every float
        return False
    return (
        finite
        and (kind.gt is None or value > kind.gt)
        and (kind.ge is None or value >= kind.ge)
        and (kind.lt is None or value < kind.lt)
        and (kind.le is None or value <= kind.le)
    )


def _bounds(kind: inspect.IntType | inspect.FloatType) -> str:
    """Return the range in words, as it follows what has it; empty if it has none."""
    low = kind.ge if kind.gt is None else kind.gt
    high = kind.le if kind.lt is None else kind.lt
    if low is not None and high is not None:
        left, right = "[" if kind.gt is None else "(", "]" if kind.lt is None else ")"
        return f" in {left}{low}, {high}{right}"
    if low is not None:
        return f", {low} or more" if kind.gt is None else f", more than {low}"
    if high is not None:
        return f", at most {high}" if kind.lt is None else f", less than {high}"
    return ""
