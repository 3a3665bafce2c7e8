"""What the verbs share: the app, errors as one line, and a run that can be stopped."""

import asyncio
import signal
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, NoReturn, TypeVar

import msgspec
import typer
from rich.console import Console

from neurosnap.config.recordings import free_path, new_path
from neurosnap.errors import InvalidValueError, NeurosnapError

T = TypeVar("T")

LOST = 3

app = typer.Typer(
    name="neurosnap",
    help="A snapshot memory whose sensors are processes that compute by messages.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
screen = Console(stderr=True, highlight=False)

Log = Annotated[Path, typer.Argument(metavar="LOG", help="A recording (.mcap).")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object last.")]
Tls = Annotated[
    str, typer.Option(metavar="DIR", help="Keys, made by `neurosnap keys DIR`.")
]
Connect = Annotated[
    str, typer.Option(metavar="ENDPOINT", help="Where the swarm's hub listens.")
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Go over a network without keys.")
]
OptionalTick = Annotated[
    int | None, typer.Option(metavar="TICK", help="As it was after this tick.")
]


@contextmanager
def errors() -> Iterator[None]:
    """Turn our errors into one line and an exit code."""
    try:
        yield
    except InvalidValueError as error:
        fail(str(error), 2)
    except NeurosnapError as error:
        fail(str(error), 1)
    except OSError as error:
        fail(f"{error.filename or 'system'}: {error.strerror or error}", 1)


def fail(text: str, code: int) -> NoReturn:
    """Say what went wrong, and end with `code`."""
    screen.print(f"[red]error:[/red] {_plain(text)}", soft_wrap=True)
    raise typer.Exit(code)


def _plain(text: str) -> str:
    """Keep rich from reading brackets in somebody's text as its own."""
    return text.replace("[", r"\[")


def ranges(name: str, text: str) -> list[int]:
    """Return the numbers in ``0-3,7``, ascending.

    Raises:
        InvalidValueError: It holds something else, or a number twice.
    """
    numbers: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise InvalidValueError(name, "must be like 0-499 or 3,7,9-12", text)
        numbers += range(int(first), int(last if dash else first) + 1)
    if not numbers or len(set(numbers)) < len(numbers):
        raise InvalidValueError(name, "must name each once", text)
    return sorted(numbers)


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


def check_swarm(swarm: str) -> None:
    """Refuse an id that could not stand in a key.

    Raises:
        InvalidValueError: It holds something else than letters and digits.
    """
    if not swarm.isalnum():
        raise InvalidValueError("swarm", "must be letters and digits", swarm)


def convert(kind: type[T], **given: object) -> T:
    """Return a struct of what was given, checked.

    Raises:
        InvalidValueError: Something breaks its rule.
    """
    try:
        return msgspec.convert(given, kind)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at ")
        name = place.strip("`$.") or "options"
        raise InvalidValueError(name, reason, given.get(name)) from error


def say(as_json: bool) -> Console:
    """Return where people are told: not where the JSON goes."""
    return screen if as_json else Console(highlight=False)


def print_json(facts: object) -> None:
    """Print an object for programs, on a line of its own."""
    typer.echo(msgspec.json.encode(facts).decode())


def run_async(work: Callable[[asyncio.Event], Awaitable[T]]) -> T:
    """Run `work`; Ctrl-C or SIGTERM asks it to stop, a second one cancels it."""

    async def main() -> T:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        task = asyncio.current_task()

        def on_signal() -> None:
            if stop.is_set() and task is not None:
                task.cancel()
            stop.set()

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, on_signal)
        return await work(stop)

    try:
        return asyncio.run(main())
    except asyncio.CancelledError:
        fail("interrupted before everything had ended in order", 1)


def at_most(asked: int | None, length: int | None) -> int:
    """Return how many ticks to run: at most as many as the source has."""
    if length is None:
        return 300 if asked is None else asked
    return length if asked is None else min(asked, length)


def new_log(source: str, out: Path | None) -> Path:
    """Return where to record: `out`, or a new name under ``logs/``."""
    if out is not None:
        return free_path(out)
    path = new_path(source)
    path.parent.mkdir(exist_ok=True)
    return path
