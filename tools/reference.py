#!/usr/bin/env python3
"""Write the pages of docs/ and the schema that are generated from the code.

The commands and their options come from the command line's own parser, the keys of the
TOML file from its JSON Schema, and the messages from the structs on the wire. A test
holds the pages against them.
"""

import argparse
import inspect
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

# Run as a file, its folder is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import msgspec
import typer

from neurosnap import wire
from neurosnap.apps.cli import app
from neurosnap.errors import either
from neurosnap.recording.format import schemas
from tools.json_schema import schema, texts_below

PAGES = Path(__file__).resolve().parents[1] / "docs"
_NOTE = "<!-- Made by tools/reference.py: change the code, and run that. -->"
_LARGEST = 2**31 - 1
"""What whole numbers on the wire go up to; it stands in the text, not in each row."""
_WORDS: dict[object, str] = {str: "TEXT", int: "INT", float: "NUMBER", Path: "PATH"}


def commands() -> str:
    """Return the page of all commands, as their `--help` tells of them."""
    group: Any = typer.main.get_command(app)
    text = (
        "This page has every command with its options, which `--help` prints, too."
        " [commands.md](../commands.md) lists the commands by task."
    )
    return _page("Every command", text, _verbs("neurosnap", group))


def _verbs(name: str, group: Any) -> Iterator[str]:  # noqa: ANN401 - typer's own
    """Yield a section for each command of a group."""
    for verb in group.list_commands(None):
        command = group.get_command(None, verb)
        if hasattr(command, "commands"):
            yield from _verbs(f"{name} {verb}", command)
        else:
            yield from _verb(f"{name} {verb}", command)


def _verb(name: str, command: Any) -> Iterator[str]:  # noqa: ANN401 - typer's own
    given = command.params
    arguments = [one for one in given if one.param_type_name == "argument"]
    options = [one for one in given if one.param_type_name == "option"]
    words = [_placed(one) if one.required else f"[{_placed(one)}]" for one in arguments]
    usage = " ".join([name, *words, *(["[OPTIONS]"] if options else [])])
    yield from (f"## {name}", "", f"`{usage}`", "")
    yield from (inspect.cleandoc(command.help), "")
    if command.epilog:
        yield from (command.epilog.replace("Example: ", "Example: `") + "`", "")
    if arguments:
        meant = [(_choice(_placed(one)), one.help or "") for one in arguments]
        yield from _table(("argument", "meaning"), meant)
    panels = dict.fromkeys(one.rich_help_panel or "" for one in options)
    for panel in panels:
        if len(panels) > 1:
            yield from (f"**{panel or 'Other options'}**", "")
        rows = [
            (_flags(one), one.help or "", _default(one))
            for one in options
            if (one.rich_help_panel or "") == panel
        ]
        yield from _table(("option", "meaning", "default"), rows)


def _placed(argument: Any) -> str:  # noqa: ANN401 - typer's own
    """Return what stands for an argument."""
    word: str = argument.metavar or argument.name.upper()
    if word.startswith("["):
        word = word[1:-1]
    return f"{word}..." if argument.nargs < 0 else word


def _flags(option: Any) -> str:  # noqa: ANN401 - typer's own
    """Return the names of an option, and what stands for its value."""
    names = [*option.opts, *option.secondary_opts]
    kind = option.type_descriptor.annotation
    word = option.metavar
    if word is None and not option.is_flag:
        choice = get_origin(kind) is Literal
        word = "|".join(get_args(kind)) if choice else _WORDS.get(kind, "TEXT")
    shown = ", ".join(_code(name) for name in names)
    return f"{shown} {_choice(word)}" if word else shown


def _choice(word: str) -> str:
    """Return what stands for a value: one word, or several to choose from.

    No bar, which tables of some programs cannot hold in code and others only escaped.
    """
    return either(_code(one) for one in word.split("|"))


def _default(option: Any) -> str:  # noqa: ANN401 - typer's own
    """Return the default of an option, in its own words or as its value."""
    if isinstance(option.show_default, str):
        return option.show_default
    if option.default in (None, "", ()) or option.is_flag:
        return ""
    return _code(str(option.default))


def toml() -> str:
    """Return the page of all keys of the TOML file."""
    text = (
        "This page has every table and key of the TOML file that describes a run."
        " `neurosnap check` reports what is wrong with a file;"
        " `examples/swarm.schema.json` is the same as JSON Schema, for editors, and"
        " `examples/swarm.toml` has every table. [sensors.md](../sensors.md) says how"
        " to connect sensors. A key without a default must be given, unless it may be"
        " left out."
    )
    return _page("The TOML file", text, _tables(schema()["$defs"]))


def schema_text() -> str:
    """Return the JSON Schema of the TOML file, as text."""
    text = msgspec.json.format(msgspec.json.encode(schema()), indent=2)
    return f"{text.decode()}\n"


def _tables(found: dict[str, Any]) -> Iterator[str]:
    """Yield a section for each table, in the order of the file."""
    waiting = [("", "Config")]
    while waiting:
        path, name = waiting.pop(0)
        table = found[name]
        properties = table["properties"]
        nested = []
        for key, rule in properties.items():
            for kind, listed in _references(rule):
                inner = f"{path}.{key}".lstrip(".")
                nested.append((f"[{inner}]" if listed else inner, kind))
        waiting = nested + waiting
        if not path:
            continue
        yield from (f"## {_heading(path, properties)}", "", table["description"], "")
        rows = [
            (f"`{key}`", _value(rule), rule.get("description", ""), default)
            for key, rule in properties.items()
            if not list(_references(rule))
            for default in [_shown_default(rule, key in table.get("required", ()))]
        ]
        if rows:
            yield from _table(("key", "value", "meaning", "default"), rows)


def _heading(path: str, properties: dict[str, Any]) -> str:
    """Return how a table begins in the file; what tells its kind goes with it."""
    kinds = properties.get("kind", {}).get("enum", ())
    kind = f', kind = "{kinds[0]}"' if len(kinds) == 1 else ""
    return f"`[{path}]`{kind}"


def _references(rule: dict[str, Any]) -> Iterator[tuple[str, bool]]:
    """Yield the tables that a key holds, and whether it is a list of them."""
    if "$ref" in rule:
        yield rule["$ref"].rpartition("/")[2], False
    for one in rule.get("anyOf", ()):
        yield from _references(one)
    if "items" in rule:
        for name, _ in _references(rule["items"]):
            yield name, True


def _value(rule: dict[str, Any]) -> str:
    """Return in words what a key may hold."""
    if "anyOf" in rule:
        return either(dict.fromkeys(_value(one) for one in rule["anyOf"]))
    if "enum" in rule:
        return either(f'`"{one}"`' for one in rule["enum"])
    match rule["type"]:
        case "array":
            return f"a list, each {_value(rule['items'])}"
        case "boolean":
            return "true or false"
        case "object":
            return "a table"
        case "string":
            return "text"
        case kind:
            word = {"integer": "a whole number", "number": "a number"}[kind]
            return word + _bounds(rule)


def _bounds(rule: dict[str, Any]) -> str:
    """Return the range of a number in words."""
    words = {
        "minimum": "{} or more",
        "exclusiveMinimum": "more than {}",
        "maximum": "at most {}",
        "exclusiveMaximum": "less than {}",
    }
    said = [
        text.format(rule[name])
        for name, text in words.items()
        if rule.get(name, _LARGEST) != _LARGEST
    ]
    return f", {' and '.join(said)}" if said else ""


def _shown_default(rule: dict[str, Any], required: bool) -> str:
    if required:
        return "must be given"
    if "default" not in rule:
        return "may be left out"
    return _code(msgspec.json.encode(rule["default"]).decode())


def messages() -> str:
    """Return the page of all messages."""
    text = (
        "This page has every message on the wire and in recordings, in the order of"
        " their channels, as `neurosnap/wire.py` declares it. A message travels under"
        " the key `neurosnap/<swarm>/` and what is given below, where `PART` stands for"
        " its sender, such as `cell/3`, and a star for a number of a cell or worker. Its"
        " payload is JSON: an object with its topic as `type`, and its fields. Whole"
        " numbers go up to 2,147,483,647. What has its default may be missing. This is schema"
        f" {wire.SCHEMA}; a recording of another schema is refused."
    )
    return _page(
        "Messages",
        text,
        [line for topic in wire.TOPICS for line in _message(topic)],
    )


def _message(topic: str) -> Iterator[str]:
    kind = wire.TOPICS[topic]
    yield from (f"## {topic}", "")
    yield from (inspect.cleandoc(kind.__doc__ or ""), "")
    yield from (
        f"Key `{wire.said_by('PART', topic)}`; in a recording channel `/{topic}` with"
        f" schema `{schemas.name(kind)}`.",
        "",
    )
    yield from _fields(kind, schemas.schema(kind)["properties"])


def _fields(kind: type[msgspec.Struct], properties: dict[str, Any]) -> Iterator[str]:
    """Yield the table of a struct's fields, and those of what its lists hold."""
    rows, texts, held = [], dict(texts_below(kind)), list[str]()
    for field in msgspec.structs.fields(kind):
        default = ""
        if not field.required:
            default = _code(msgspec.json.encode(field.default).decode())
        rule = properties[field.encode_name]
        shown = "bytes, in base64" if rule.get("contentEncoding") else _value(rule)
        rows.append(
            (_code(field.encode_name), shown, texts.get(field.name, ""), default)
        )
        if "properties" in (items := rule.get("items", {})):
            held += [f"Each of `{field.encode_name}`:", ""]
            held += _fields(get_args(field.type)[0], items["properties"])
    yield from _table(("field", "value", "meaning", "default"), rows)
    yield from held


def _page(title: str, text: str, lines: Iterable[str]) -> str:
    return "\n".join([f"# {title}", "", _NOTE, "", text, "", *lines]).rstrip() + "\n"


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for row in rows:
        yield f"| {' | '.join(map(_cell, row))} |"
    yield ""


def _cell(text: str) -> str:
    """Return a text in which nothing but what is in backticks means anything."""
    parts = " ".join(text.split()).replace("|", "\\|").split("`")
    parts[::2] = [re.sub(r"([*<])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def _code(text: str) -> str:
    return f"`{text}`"


MADE = {
    "reference/every_command.md": commands,
    "reference/toml.md": toml,
    "reference/messages.md": messages,
    "../examples/swarm.schema.json": schema_text,
}


def main() -> None:
    """Write the pages."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    for name, made in MADE.items():
        (PAGES / name).write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    main()
