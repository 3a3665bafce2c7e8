"""Turns errors and signals into exit codes, and ends a run cleanly on either."""

import asyncio
import signal
import socket
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Literal, NoReturn, TypeAlias, TypeVar

import msgspec
import typer
from rich.text import Text

from neurosnap.apps.cli.run_flags import FLAG, NETWORK
from neurosnap.apps.cli.terminal_output import screen, warn
from neurosnap.apps.new_files import free_log, new_path
from neurosnap.errors import (
    InvalidValueError,
    NeurosnapError,
    NoRecordingError,
    NothingBegunError,
)
from neurosnap.system.signals import INTERRUPTED, heeded, quit_now, unheeded

if TYPE_CHECKING:
    from neurosnap.recording.read.recording import Recording

T = TypeVar("T")
LOST = 3
_TWICE = 0.5
"""Seconds in which a second SIGINT is the first again: `timeout -s INT` sends it to the
program and to its group."""

Log = Annotated[Path, typer.Argument(metavar="LOG", help="A recording (.mcap).")]
Form: TypeAlias = Literal["text", "json"]
Format = Annotated[
    Form,
    typer.Option(
        "--format",
        help="Print text, or the result as one JSON object on the last line of standard"
        " output.",
    ),
]
Force = Annotated[
    bool,
    typer.Option("--force", metavar=FLAG, help="Replace the file that is there."),
]
Connect = Annotated[
    str,
    typer.Option(
        metavar="ENDPOINT",
        rich_help_panel=NETWORK,
        help="Where the swarm's hub listens, such as tcp/127.0.0.1:7447.",
    ),
]
OptionalTick = Annotated[
    int | None,
    typer.Option(
        metavar="TICK",
        help="Show what was learned by this tick.",
        show_default="the last one",
    ),
]


@contextmanager
def errors() -> Iterator[None]:
    """Turn our errors into one line and an exit code."""
    try:
        yield
    except NothingBegunError:
        warn("interrupted")
        raise typer.Exit(INTERRUPTED) from None
    except (InvalidValueError, NoRecordingError) as error:
        fail(str(error), 2)
    except NeurosnapError as error:
        fail(str(error), 1)
    except BrokenPipeError:
        raise  # by `| head`, which has read enough: click ends without a word
    except MemoryError as error:
        fail(f"memory: must be enough for so many sensors and ticks, got: {error}", 1)
    except OSError as error:
        fail(f"{error.filename or 'system'}: {error.strerror or error}", 1)


def fail(text: str, code: int) -> NoReturn:
    """Print an error, and end with exit code `code`."""
    # No markup: the text may hold what rich would read as markup.
    screen.print(Text.assemble(("error:", "red"), f" {text}"), soft_wrap=True)
    raise typer.Exit(code)


def end_by(recording: "Recording") -> None:
    """Print what a recording lacks; if it lacks anything, end with exit code `LOST`."""
    warn(*(f"damaged: {line}" for line in recording.damage))
    if (cut := recording.cut) is not None:
        warn(f"cut short: {recording.path} at byte {cut.offset} of {cut.size}")
    if not recording.whole:
        warn("the recording is not whole: `neurosnap info` says what it lacks")
        raise typer.Exit(LOST)


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


def run_async(work: Callable[[asyncio.Event], Awaitable[T]]) -> T:
    """Run `work`; a signal to end asks it to stop, a second Ctrl-C cancels it."""

    async def main() -> T:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        task = asyncio.current_task()
        insists = float("inf")  # when a Ctrl-C is the second

        def on_signal(number: int) -> None:
            nonlocal insists
            if number == signal.SIGINT and loop.time() > insists and task is not None:
                task.cancel()
            elif not stop.is_set():
                insists = loop.time() + _TWICE
                stop.set()

        with heard(loop, on_signal):
            return await work(stop)

    try:
        return asyncio.run(main())
    except asyncio.CancelledError:
        fail("interrupted before everything had ended in order", 1)


def new_log(source: str, out: Path | None) -> Path:
    """Return where to record: `out`, or a new name under ``logs/``."""
    if out is not None:
        return free_log(out)
    path = new_path(source)
    path.parent.mkdir(exist_ok=True)
    return path


# Signals while a verb works; before that, see `neurosnap.system.signals`. While a file
# is written they unwind that, so that no draft stays. While a swarm runs they ask it to
# end in order, and count for nothing from then on.


@contextmanager
def unwinding() -> Iterator[None]:
    """Let signals end the block as an exception does, with exit code 128 + number."""
    before = {number: signal.getsignal(number) for number in heeded()}
    for number in before:
        signal.signal(number, _unwind)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _unwind(number: int, frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


@contextmanager
def heard(
    loop: asyncio.AbstractEventLoop, on_signal: Callable[[int], None]
) -> Iterator[None]:
    """Call `on_signal` on the event loop with the number of each signal.

    Once the block is left the program has ended in order, and has only to say so: where
    it would have quit at a signal before, it ignores it then. The loop's own
    ``add_signal_handler`` would leave a gap in which a signal kills.
    """
    before = {number: signal.getsignal(number) for number in heeded()}
    reading, writing = socket.socketpair()
    with reading, writing:
        reading.setblocking(False)
        writing.setblocking(False)

        def read() -> None:
            for number in reading.recv(4096):
                on_signal(number)

        loop.add_reader(reading, read)
        waker = signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
        for number in before:
            signal.signal(number, unheeded)
        try:
            yield
        finally:
            for number, handler in before.items():
                # Ignored in earnest: Python gives other handlers back before it ends.
                quits = handler is quit_now
                signal.signal(number, signal.SIG_IGN if quits else handler)
            signal.set_wakeup_fd(waker)
            loop.remove_reader(reading)
