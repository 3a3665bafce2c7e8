"""`njit` of Numba with a cache in the user's folder.

Beside the source, where Numba puts it by itself, it would outlive an uninstall, and an
installation that the user cannot write to would have no place for it.
"""

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba

P = ParamSpec("P")
R = TypeVar("R")

_logger = logging.getLogger(__name__)


def njit(*, nogil: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that compiles a function at its first call, and keeps that.

    Args:
        nogil: Whether other threads may run meanwhile.
    """

    def compiled(function: Callable[P, R]) -> Callable[P, R]:
        config: Any = numba.config
        before = config.CACHE_DIR
        # Not for others in this process: only while Numba chooses the place.
        config.CACHE_DIR = before or _folder()
        try:
            made: Callable[P, R] = numba.njit(cache=True, nogil=nogil)(function)
        finally:
            config.CACHE_DIR = before
        return made

    return compiled


def _folder() -> str:
    """Return where compiled code is kept, made if need be; nothing: where Numba likes.

    The process that makes the folder says that it will take a while.
    """
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    folder = Path(os.path.expanduser(cache)) / "neurosnap"  # noqa: PTH111 - may fail
    if not folder.is_absolute():
        return ""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700)
    except FileExistsError:
        return str(folder)
    except OSError:
        return ""
    _logger.warning("first start: compiling for this machine, about 20 s, once")
    return str(folder)
