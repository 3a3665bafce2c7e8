"""``neurosnap config``, and command-line options that override a TOML file."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import FLAG, run_options
from neurosnap.apps.cli.shared import Json, app, errors, print_json, say, was_given
from neurosnap.errors import InvalidValueError
from neurosnap.sources.protocol import Argument

if TYPE_CHECKING:
    from neurosnap.apps.config.prepare import Prepared

_PATHS = {"out", "folder", "tls"}
_RECORDING = {"out", "folder", "frames", "split", "keep"}
"""Flags of no use where nothing is recorded."""

config = typer.Typer(help="Check TOML files that describe a run.", no_args_is_help=True)
app.add_typer(config, name="config")


@config.command()
def check(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="The TOML file to check.")
    ],
    static: Annotated[
        bool,
        typer.Option(
            "--static",
            metavar=FLAG,
            help="Check the file alone, and open nothing that it names.",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Find everything that would keep a run from starting, with line numbers."""
    from neurosnap.apps.config.load import load, look
    from neurosnap.apps.config.prepare import prepare
    from neurosnap.apps.config.problems import ConfigError

    with errors():
        try:
            if static:
                load(file)
            else:
                prepare(look(file))
        except ConfigError as error:
            if as_json:
                faults = {"faults": error.faults, "more": error.more}
                print_json({"file": str(file), **faults})
            raise
        say(as_json).print(f"{file}: no faults", markup=False, soft_wrap=True)
        if as_json:
            print_json({"file": str(file), "faults": [], "more": 0})


@config.command()
def schema() -> None:
    """Print the JSON Schema of these files, which editors use to check them."""
    from neurosnap.apps.config.json_schema import schema as schema_of_config

    with errors():
        text = msgspec.json.format(msgspec.json.encode(schema_of_config()), indent=2)
        typer.echo(text)


def described(
    context: typer.Context, before: Mapping[str, object] = MappingProxyType({})
) -> "Prepared":
    """Return what a run is started with, by the arguments of a verb.

    Its `source` may be a file that describes a run, with the ending ``.toml``; flags go
    before it if they were given, and their defaults do not.

    Args:
        context: The verb's; its parameters are `source`, `given` and some
            options of a run.
        before: What `--broker` lets go before the file, by dotted keys.

    Raises:
        InvalidValueError: Something is wrong with it; what a file says has its line.
    """
    from neurosnap.apps.config.load import look
    from neurosnap.apps.config.prepare import prepare

    name = str(context.params["source"])
    file = Path(name) if name.lower().endswith(".toml") else None
    keys = {
        flag: each.key
        for flag, each in run_options().items()
        if was_given(context, flag)
    }
    names = {key: flag for flag, key in keys.items()}
    overrides = {key: context.params[flag] for flag, key in keys.items()}
    overrides |= before
    names |= dict.fromkeys(before, "broker")
    for flag in keys.keys() & _PATHS:
        if not context.params[flag]:
            continue  # no path at all, whatever the file says
        # Flags are relative to where they are typed, and not to the file.
        path = Path(context.params[flag])
        overrides[keys[flag]] = str(path if file is None else path.absolute())
    if file is None:
        # A file of readings, too: whoever opens it tells them apart.
        overrides |= {"source.kind": "world", "source.id": name}
        names["source.id"] = "source"
    for key, value in _arguments(context.params["given"] or []).items():
        overrides[f"source.arguments.{key}"] = value
    loaded = look(file, overrides, names)
    for flag in _RECORDING & keys.keys():
        recorded = loaded.config.recording.record or "recording" in loaded.wrong
        if context.params[flag] and not recorded:
            rule = "must go with a recording, and nothing is recorded"
            raise InvalidValueError(flag, rule, str(context.params[flag]))
    return prepare(loaded)


def _arguments(given: list[str]) -> dict[str, Argument]:
    """Return the world's arguments: JSON's numbers, true, false; anything else text."""
    arguments: dict[str, Argument] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise InvalidValueError("set", "must be NAME=VALUE", text)
        try:
            arguments[name] = msgspec.json.decode(value, type=Argument)
        except msgspec.DecodeError:
            arguments[name] = value
        except UnicodeEncodeError as error:
            raise InvalidValueError("set", "must be text in UTF-8", text) from error
    return arguments
