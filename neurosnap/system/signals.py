"""Signal handling before a command has begun: a signal ends the program at once.

SIGINT, SIGTERM and SIGHUP mean the same. Until there is something to end in order, or
to tidy up (`neurosnap.apps.cli.errors_and_signals`), they end the program at once, with
one line and exit code 130. A SIGHUP that is ignored, as under ``nohup``, stays ignored.

Imports next to nothing: a handler that comes late leaves a traceback.
"""

import os
import signal

TYPE_CHECKING = False  # as type checkers know it; typing takes 15 ms
if TYPE_CHECKING:
    from types import FrameType
    from typing import NoReturn

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
INTERRUPTED = 130
_SHOW_CURSOR = b"\x1b[?25h"


def quit_at_once() -> None:
    """Make signals end the program at once, while it has nothing to tidy up."""
    for number in heeded():
        signal.signal(number, quit_now)


def quit_now(number: int, frame: "FrameType | None") -> "NoReturn":
    """End the program. No exception: what is being imported may swallow or print it."""
    cursor = _SHOW_CURSOR if os.isatty(2) else b""
    os.write(2, cursor + b"interrupted\n")
    os._exit(INTERRUPTED)


def unheeded(number: int, frame: "FrameType | None") -> None:
    """Do nothing. Unlike SIG_IGN, programs that are started do not inherit it."""


def heeded() -> list[signal.Signals]:
    """Return the signals that mean the end here."""
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    return [one for one in SIGNALS if one is not signal.SIGHUP or not ignored]
