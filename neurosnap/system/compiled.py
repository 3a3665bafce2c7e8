"""`njit` of Numba with a cache in the user's folder.

Beside the source, where Numba puts it by itself, it would outlive an uninstall, and an
installation that the user cannot write to would have no place for it.

Numba looks at a function's own file to tell whether what it kept is still right. But
the functions that it calls are compiled into it, and so are numbers that it imports. So
it is kept in a folder that is named by all of these: after a change to one of them,
what was made of the former is not found.
"""

import functools
import logging
import os
import threading
from collections.abc import Callable, Iterator
from hashlib import sha256
from numbers import Number
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, TypeVar, cast

if TYPE_CHECKING:
    from types import FunctionType

P = ParamSpec("P")
R = TypeVar("R")

_logger = logging.getLogger(__name__)
_lock = threading.RLock()


def njit(*, nogil: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that compiles a function at its first call, and keeps that.

    Args:
        nogil: Whether other threads may run meanwhile.
    """

    def compiled(function: Callable[P, R]) -> Callable[P, R]:
        return _Kernel(function, nogil)

    return compiled


class _Kernel(Generic[P, R]):
    """A function that Numba compiles; Numba itself is imported at the first call.

    To import it takes a third of a second and 60 MB, which most of a swarm's processes
    and most verbs never need.
    """

    def __init__(self, function: Callable[P, R], nogil: bool) -> None:
        functools.update_wrapper(self, function)
        self.function = function
        self._nogil = nogil
        self._dispatcher: Callable[P, R] | None = None

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        return self.dispatcher()(*args, **kwargs)

    def dispatcher(self) -> Callable[P, R]:
        """Return what Numba makes of the function; it compiles at the first call."""
        with _lock:
            if self._dispatcher is None:
                numba = _numba()
                before = numba.config.CACHE_DIR
                # Not for others in this process: only while Numba chooses the place.
                if folder := before or _folder():
                    made_of = sha256(b"".join(_made_of(self, set())))
                    numba.config.CACHE_DIR = f"{folder}/{made_of.hexdigest()[:16]}"
                try:
                    make = numba.njit(cache=True, nogil=self._nogil)
                    self._dispatcher = made = make(self.function)
                finally:
                    numba.config.CACHE_DIR = before
                # From now on a call goes there without a frame of Python in between,
                # which would take as long as a small kernel.
                direct = {"__call__": staticmethod(made)}
                self.__class__ = type(type(self).__name__, (_Kernel,), direct)
            return self._dispatcher


def _made_of(kernel: "_Kernel[Any, Any]", seen: set[object]) -> Iterator[bytes]:
    """Yield all that a compiled function depends on: sources, and numbers by name."""
    if kernel in seen:
        return
    seen.add(kernel)
    function = cast("FunctionType", kernel.function)
    yield _read(function.__code__.co_filename)
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, _Kernel):
            yield from _made_of(value, seen)
        elif isinstance(value, Number):
            yield f"{name}={value!r};".encode()


@functools.cache
def _read(path: str) -> bytes:
    """Return a source, or nothing if it is in no file."""
    try:
        return Path(path).read_bytes()
    except OSError:
        return b""


@functools.cache
def _numba() -> Any:  # noqa: ANN401 - it has no types
    """Import Numba, and let its functions call ours."""
    import numba
    from numba.extending import typeof_impl

    @typeof_impl.register(_Kernel)
    def _(kernel: _Kernel[..., object], _context: object) -> object:
        made: Any = kernel.dispatcher()
        return numba.types.Dispatcher(made)

    return numba


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
