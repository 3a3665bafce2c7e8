"""Command-line options of a run, made from the tables that declare them.

In the help they stand in panels, which are named here.
"""

import inspect
import re
from collections.abc import Callable
from functools import cache, wraps
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    NamedTuple,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import typer

from neurosnap.apps.config.tables import Config
from neurosnap.protocol.option import Shown, declared
from neurosnap.protocol.run_options import FEW_CELLS

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

HOSTS = (
    "Process: each cell is a process of its own. Worker: a few processes share them."
)
"""The help of `cells`, for verbs that cannot have them inline."""
AUTO_HOSTS = f"{HOSTS} Auto: process up to {FEW_CELLS} sensors, else worker."
"""The same, for verbs that may choose."""

Source = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE", help="The id of a world (neurosnap/Path-v0), or a CSV file."
    ),
]
Described = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="The id of a world (neurosnap/Path-v0); or a CSV file: a line of sensor"
        " names, then a line of 0s and 1s for each tick (a first column `time` is left"
        " out); or a TOML file that describes the whole run. Options on the command line"
        " override that file.",
    ),
]
Given = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        rich_help_panel=SOURCE,
        help="Set an argument of the world, such as places=10. May be repeated.",
    ),
]


def in_bytes(size: str | int) -> int:
    """Return a size in bytes, given as that or in KiB, MiB or GiB.

    Raises:
        typer.BadParameter: It is something else.
    """
    units = {"": 1, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
    text = str(size)
    number = text.rstrip("KMGiB")
    unit = text[len(number) :]
    if not (number.isascii() and number.isdecimal()) or unit not in units:
        raise typer.BadParameter(f"must be like 256MiB, got {text!r}")
    return int(number) * units[unit]


def as_share(share: str | float) -> float | str:
    """Return a number that is given as text, and any other text as it is.

    Example:
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
    """An option of a run, as its field declares it."""

    key: str
    """The dotted key in a description, such as ``cells.kind``."""
    kind: Any
    """The type of its values, as typer takes it."""
    default: object
    shown: Shown
    panel: str

    def parameter(self, flag: str, text: str = "") -> Any:  # noqa: ANN401 - typer's
        """Return it as the default value of a verb's parameter.

        Args:
            flag: The parameter's name.
            text: The help, where a verb means it otherwise than a run does.
        """
        name = _as_flag(flag)
        is_flag = self.kind is bool
        return typer.Option(
            self.default,
            f"{name}/--no-{name[2:]}" if self.default is True else name,
            metavar=FLAG if is_flag else self.shown.unit or None,
            parser=_PARSERS.get(self.shown.unit),
            rich_help_panel=self.panel,
            help=text or _OPTION.sub(lambda name: _as_flag(name[1]), self.shown.text),
            show_default=self.shown.default or True,
        )


@cache
def run_options() -> dict[str, RunOption]:
    """Return the options of a run by their names, in the order of the help."""
    found: dict[str, RunOption] = {}
    tables = get_type_hints(Config)
    for table, panel in _PANELS.items():
        for one in declared(tables[table]):
            key = f"{table}.{one.field}"
            option = RunOption(key, _simple(one.kind), one.default, one.shown, panel)
            found[one.shown.flag or one.field] = option
    return found


def option(flag: str, text: str = "") -> Any:  # noqa: ANN401 - typer's
    """Return the default value of a verb's parameter that is an option of a run.

    Args:
        flag: The option's name, which is the parameter's too.
        text: The help, where the verb means it otherwise than a run does.
    """
    return run_options()[flag].parameter(flag, text)


def with_run_options(
    *left_out: str,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a verb the options of a run, but for those that it has itself.

    They stand behind its first two parameters, context and source. The verb itself is
    called without them: it reads them from its context, by `described`.

    Args:
        left_out: Names of options that the verb has no use for.

    Raises:
        KeyError: There is no option of such a name.
    """
    for flag in left_out:
        run_options()[flag]

    def decorate(verb: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(verb).parameters
        made = [
            inspect.Parameter(
                flag,
                inspect.Parameter.KEYWORD_ONLY,
                default=each.parameter(flag),
                annotation=each.kind,
            )
            for flag, each in run_options().items()
            if flag not in own and flag not in left_out
        ]
        names = {one.name for one in made}

        @wraps(verb)
        def called(**given: object) -> None:
            verb(**{name: value for name, value in given.items() if name not in names})

        first, second, *rest = [
            one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own.values()
        ]
        signature = inspect.Signature([first, second, *made, *rest])
        called.__dict__["__signature__"] = signature
        called.__annotations__ = {
            one.name: one.annotation for one in signature.parameters.values()
        }
        return called

    return decorate


def _as_flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _simple(kind: Any) -> Any:  # noqa: ANN401 - any annotation
    """Return a type as typer takes it: of a choice of types, text, parsed later."""
    choices = [one for one in get_args(kind) if one is not NoneType]
    if get_origin(kind) not in (Union, UnionType) or len(choices) == 1:
        return kind
    return str | None
