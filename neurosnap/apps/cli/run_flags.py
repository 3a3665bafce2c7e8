"""Command-line options of a run, made from the tables that declare them.

A verb has the few that are used often; `--set` reaches every key. In the help they
stand in panels, which are named here.
"""

import inspect
import re
from collections.abc import Callable
from functools import cache, wraps
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    NamedTuple,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec
import typer

from neurosnap.apps.config.tables import Config
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.option_declaration import Shown, declared

if TYPE_CHECKING:
    from neurosnap.runtime.request import RunRequest

SOURCE = "Source"
AGENT = "Agent"
LEARNING = "Learning"
CELLS = "Cells"
RECORDING = "Recording"
NETWORK = "Network"
SUPERVISION = "Supervision"
PLACEMENT = "Placement"
FLAG = ""
"""What stands beside a flag that takes no value."""

_PANELS = {
    "run": SOURCE,
    "agent": AGENT,
    "snapshot": LEARNING,
    "anomalies": LEARNING,
    "health": LEARNING,
    "cells": CELLS,
    "recording": RECORDING,
    "supervision": SUPERVISION,
    "network": NETWORK,
    "placement": PLACEMENT,
}
"""The panel of each table of a description, in the order of the help."""
_OPTION = re.compile(r"`([a-z_]+)`")
"""Another option in a help text, by the name of its field."""

Described = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="The id of a world (neurosnap/Path-v0); or a file of readings, as"
        " `neurosnap learn` takes it: in CSV a line of sensor names, then a line of 0s"
        " and 1s for each tick; or a TOML file that describes the whole run. Options on"
        " the command line override that file.",
    ),
]
Given = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set a key of the TOML file, such as agent.explore=0.5; a key without a dot"
        " is an argument of the world, such as places=10. May be repeated.",
    ),
]


def in_bytes(size: str | int) -> int:
    """Return a size in bytes, given as that or in KiB, MiB or GiB.

    Raises:
        InvalidValueError: It is something else.
    """
    units = {"": 1, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
    text = str(size)
    number = text.rstrip("KMGiB")
    unit = text[len(number) :]
    if not (number.isascii() and number.isdecimal()) or unit not in units:
        raise InvalidValueError("size", "must be like 256MiB", text)
    return int(number) * units[unit]


def as_share(share: str | float) -> float | str:
    """Return a number that is given as text, and any other text as it is.

    Examples:
        >>> as_share("0.5"), as_share("planned")
        (0.5, 'planned')
    """
    try:
        return float(share)
    except ValueError:
        return str(share)


_PARSERS: dict[str, Callable[[Any], Any]] = {"SIZE": in_bytes, "SHARE": as_share}
"""What reads the values of an option, by their unit."""


class RunOption(NamedTuple):
    """An option of a run, as the command line offers it."""

    key: str
    """The dotted key in a description, such as ``cells.kind``."""
    kind: Any
    """The type of its values, as typer takes it."""
    default: object
    shown: Shown
    panel: str | None

    def parameter(self, flag: str) -> Any:  # noqa: ANN401 - typer's
        """Return it as the default value of a verb's parameter of a name."""
        name = _as_flag(flag)
        is_flag = self.kind is bool
        return typer.Option(
            self.default,
            f"{name}/--no-{name[2:]}" if self.default is True else name,
            *(["-o"] if flag == "out" else []),
            metavar=FLAG if is_flag else self.shown.unit or None,
            parser=_PARSERS.get(self.shown.unit),
            rich_help_panel=self.panel,
            help=_OPTION.sub(lambda name: _as_flag(name[1]), self.shown.text),
            show_default=self.shown.default or True,
        )


@cache
def run_options() -> dict[str, RunOption]:
    """Return the options of a run by their names, in the order of the help."""
    found: dict[str, RunOption] = {}
    tables = get_type_hints(Config)
    for table, panel in _PANELS.items():
        found |= options_of(tables[table], panel, f"{table}.")
    return found


def options_of(
    table: type[msgspec.Struct], panel: str | None = None, prefix: str = ""
) -> dict[str, RunOption]:
    """Return the options that a table declares, by their names.

    Args:
        table: A struct.
        panel: Where they stand in the help; None if not apart from others.
        prefix: What stands before their keys.
    """
    found: dict[str, RunOption] = {}
    for one in declared(table):
        key = f"{prefix}{one.field}"
        option = RunOption(key, _simple(one.kind), one.default, one.shown, panel)
        found[one.shown.flag or one.field] = option
    return found


def option(flag: str) -> Any:  # noqa: ANN401 - typer's
    """Return the default value of a verb's parameter that is an option of a run."""
    return run_options()[flag].parameter(flag)


def with_run_options(
    *flags: str,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a verb the options of a run that `flags` names.

    They stand behind its first two parameters, context and source. The verb itself is
    called without them: it reads them from its context, by `request_of`.

    Raises:
        KeyError: There is no option of such a name.
    """
    chosen = {flag: run_options()[flag] for flag in flags}
    return with_parameters(
        **{
            flag: (each.kind, each.parameter(flag))
            for flag in run_options()
            if (each := chosen.get(flag)) is not None
        }
    )


def with_parameters(
    **parameters: tuple[Any, Any],
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a verb parameters, which it reads from its context, its first parameter.

    They stand behind its first two. The verb itself is called without them.

    Args:
        parameters: The type and the default of each.
    """
    made = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind
        )
        for name, (kind, default) in parameters.items()
    ]

    def decorate(verb: Callable[..., None]) -> Callable[..., None]:
        @wraps(verb)
        def called(**given: object) -> None:
            verb(**{name: v for name, v in given.items() if name not in parameters})

        first, second, *rest = [
            one.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            for one in inspect.signature(verb).parameters.values()
        ]
        signature = inspect.Signature([first, second, *made, *rest])
        called.__dict__["__signature__"] = signature
        called.__annotations__ = {
            one.name: one.annotation for one in signature.parameters.values()
        }
        return called

    return decorate


def request_of(context: typer.Context, *, here: bool = True) -> "RunRequest":
    """Return the request of a run, by the arguments of a verb.

    Its `source` may be a file that describes a run, with the ending ``.toml``; flags go
    before it if they were given, and their defaults do not.

    Args:
        context: The verb's; its parameters are `source`, `given`, `swarm` and some
            options of a run.
        here: As in `prepare`.

    Raises:
        InvalidValueError: Something is wrong with it; what a file says has its line.
    """
    from neurosnap.apps.config.load import described
    from neurosnap.apps.config.prepare import prepare

    flags = {
        each.key: flag
        for flag, each in run_options().items()
        if (given_by := context.get_parameter_source(flag)) is not None
        and given_by.name == "COMMANDLINE"
    }
    given = settings(context.params["given"] or [])
    given |= {key: context.params[flag] for key, flag in flags.items()}
    loaded = described(str(context.params["source"]), given, flags)
    return prepare(loaded, context.params.get("swarm", ""), here=here)


def settings(given: list[str]) -> dict[str, object]:
    """Return what `--set` sets, by dotted keys."""
    units = {each.key: each.shown.unit for each in run_options().values()}
    found: dict[str, object] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not all(part.isidentifier() for part in name.split(".")):
            raise InvalidValueError("set", "must be KEY=VALUE", text)
        key = name if "." in name else f"source.arguments.{name}"
        found[key] = in_bytes(value) if units.get(key) == "SIZE" else _value(value)
    return found


def _value(text: str) -> object:
    """Return a value as TOML has it: a number, true, false, a list; else text."""
    if text in ("nan", "inf", "-inf"):
        return float(text)
    try:
        return msgspec.json.decode(
            text, type=bool | int | float | str | list[Any] | dict[str, Any]
        )
    except msgspec.DecodeError:
        return text
    except UnicodeEncodeError as error:
        raise InvalidValueError("set", "must be text in UTF-8", text) from error


def _as_flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _simple(kind: Any) -> Any:  # noqa: ANN401 - any annotation
    """Return a type as typer takes it: of a choice of types, text, parsed later."""
    choices = [one for one in get_args(kind) if one is not NoneType]
    if get_origin(kind) not in (Union, UnionType) or len(choices) == 1:
        return kind
    return str | None
