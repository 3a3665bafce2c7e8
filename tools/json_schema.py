"""The JSON Schema of the TOML file, for editors and other programs.

It says what `neurosnap.apps.config.load` asks for, as far as a schema can: not what the
values of several keys have to do with each other, nor what a world has.
"""

import ast
import inspect
import itertools
import textwrap
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import msgspec
from msgspec.inspect import StructType

from neurosnap.apps.config.tables import Config
from neurosnap.protocol.option_declaration import declared


def schema() -> dict[str, Any]:
    """Return the schema: JSON Schema 2020-12, in the words of the structs."""
    made = _in_toml(msgspec.to_builtins(msgspec.json.schema(Config)))
    for kind in _structs(msgspec.inspect.type_info(Config)):
        table = made["$defs"][kind.__name__]
        table["description"] = inspect.getdoc(kind)
        # Unknown keys are refused, whatever a struct does with them elsewhere.
        table["additionalProperties"] = False
        texts = dict(texts_below(kind))
        for one in declared(kind):
            default = f" Default: {one.shown.default}." if one.shown.default else ""
            texts[one.field] = one.shown.text + default
        for name, text in texts.items():
            table["properties"][name]["description"] = text
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A run of neurosnap",
        **made,
    }


def _in_toml(value: Any) -> Any:  # noqa: ANN401 - any part of a schema
    """Return a part of a schema without nulls, for which TOML has no word.

    Neither has it a default for a table that is left out: those of its keys say it.
    """
    if isinstance(value, list | tuple):
        return [_in_toml(item) for item in value]
    if not isinstance(value, dict):
        return value
    kept = {
        key: _in_toml(item)
        for key, item in value.items()
        if key != "default" or not (item is None or isinstance(item, dict))
    }
    if {"type": "null"} in kept.get("anyOf", []):
        others = [one for one in kept.pop("anyOf") if one != {"type": "null"}]
        kept |= others[0] if len(others) == 1 else {"anyOf": others}
    return kept


def _structs(kind: Any) -> Iterator[type[msgspec.Struct]]:  # noqa: ANN401 - its parts
    """Return the structs that a type of `msgspec.inspect` is made of."""
    if isinstance(kind, StructType):
        yield kind.cls
    inner = [getattr(kind, name, None) for name in ("type", "item_type")]
    inner += [field.type for field in getattr(kind, "fields", ())]
    for one in (*inner, *getattr(kind, "types", ())):
        if one is not None:
            yield from _structs(one)


def texts_below(kind: type[msgspec.Struct]) -> Iterator[tuple[str, str]]:
    """Return the fields that have a text below them, inherited ones too, and the text.

    Python does not keep these texts; they are read from the source.
    """
    for base in reversed(kind.__mro__):
        if base is not msgspec.Struct and issubclass(base, msgspec.Struct):
            with suppress(OSError):  # made at run time, of declared options
                yield from _own_docstrings(base)


def _own_docstrings(kind: type[msgspec.Struct]) -> Iterator[tuple[str, str]]:
    source = textwrap.dedent(inspect.getsource(kind))
    (definition,) = ast.parse(source).body
    body = definition.body if isinstance(definition, ast.ClassDef) else []
    for above, below in itertools.pairwise(body):
        match above, below:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                yield name, inspect.cleandoc(text)
