"""`njit` of Numba with a cache in the user's folder.

Beside the source, where Numba puts it by itself, it would outlive an uninstall, and an
installation that the user cannot write to would have no place for it. Numba unpickles
what it finds there, so a folder that another user owns or can write to is not used.

Numba looks at a function's own file to tell whether what it kept is still right. But
the functions that it calls are compiled into it, and so are numbers that it imports. So
it is kept in a folder that is named by all of these: after a change to one of them,
what was made of the former is not found.
"""

import functools
import logging
import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from numbers import Number
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, TypeVar, cast

from neurosnap.system.durable import is_own

if TYPE_CHECKING:
    from types import FunctionType

P = ParamSpec("P")
R = TypeVar("R")
_EVERY = 10.0  # seconds between two lines of progress
_logger = logging.getLogger(__name__)
_lock = threading.RLock()
_kernels: "list[_Kernel[Any, Any]]" = []
_left: float | None = None  # seconds for which kernels are interpreted
_inside = False


def njit(
    *, nogil: bool = False, plain: Callable[..., Any] | None = None
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that compiles a function at its first call, and keeps that.

    Args:
        nogil: Whether other threads may run meanwhile.
        plain: What does the same where nothing is compiled; None: the function.
    """

    def compiled(function: Callable[P, R]) -> Callable[P, R]:
        return _Kernel(function, nogil, plain or function)

    return compiled


@contextmanager
def interpreted(seconds: float) -> Iterator[None]:
    """Let Python run what is not compiled yet, until that has taken so many seconds.

    What follows is the same. For few sensors, or few ticks, it takes less time than to
    compile. What was compiled before is loaded, unless nothing is ever to be compiled.
    It holds for the whole process; within another it changes nothing.
    """
    global _left
    before = _left
    if _left is None:
        _left = seconds
    try:
        yield
    finally:
        _left = before


class _Kernel(Generic[P, R]):
    """A function that Numba compiles; Numba itself is imported at the first call.

    To import it takes a third of a second and 60 MB, which most of a swarm's processes
    and most verbs never need.
    """

    def __init__(
        self, function: Callable[P, R], nogil: bool, plain: Callable[P, R]
    ) -> None:
        functools.update_wrapper(self, function)
        self.function = function
        self.plain = plain
        self._nogil = nogil
        self._dispatcher: Callable[P, R] | None = None
        _kernels.append(self)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        global _left, _inside
        if _inside:  # what called this is interpreted
            return self.plain(*args, **kwargs)
        if _left is None or _left <= 0 or (_left < math.inf and self.is_kept):
            return self.dispatcher()(*args, **kwargs)
        _inside, began = True, time.perf_counter()
        try:
            return self.plain(*args, **kwargs)
        finally:
            _inside, _left = False, _left - (time.perf_counter() - began)

    @functools.cached_property
    def is_kept(self) -> bool:
        """Whether it was compiled before, so that it has only to be loaded."""
        return (
            any(Path(folder).rglob("*.nbi")) if (folder := _folder_of(self)) else False
        )

    def dispatcher(self) -> Callable[P, R]:
        """Return what Numba makes of the function; it compiles at the first call."""
        with _lock:
            if self._dispatcher is None:
                numba = _numba()
                before = numba.config.CACHE_DIR
                folder = _folder_of(self)
                # Not for others in this process: only while Numba chooses the place.
                numba.config.CACHE_DIR = folder
                try:
                    make = numba.njit(cache=bool(folder), nogil=self._nogil)
                    self._dispatcher = made = make(self.function)
                finally:
                    numba.config.CACHE_DIR = before
                # From now on a call goes there without a frame of Python in between,
                # which would take as long as a small kernel.
                direct = {"__call__": staticmethod(made)}
                self.__class__ = type(type(self).__name__, (_Kernel,), direct)
            return self._dispatcher

    def has_made(self, dispatcher: object) -> bool:
        """Return whether this is what Numba made of the function."""
        return self._dispatcher is dispatcher


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
    """Import Numba, let its functions call ours, and say when it compiles ours."""
    import numba
    from numba.core import event
    from numba.extending import typeof_impl

    @typeof_impl.register(_Kernel)
    def _(kernel: _Kernel[..., object], _context: object) -> object:
        made: Any = kernel.dispatcher()
        return numba.types.Dispatcher(made)

    count, next_line = 0, 0.0

    def on_event(about: Any) -> None:  # noqa: ANN401
        nonlocal count, next_line
        if not any(one.has_made(about.data["dispatcher"]) for one in _kernels):
            return  # a function of the program that uses us
        if about.is_start and not next_line:
            once = ", once" if cache_folder() else ""
            _logger.warning("compiling for this machine%s: about 20 s", once)
            next_line = time.monotonic() + _EVERY
        elif about.is_end:
            count += 1
            if time.monotonic() >= next_line:
                _logger.warning("compiled %d functions so far", count)
                next_line = time.monotonic() + _EVERY

    class Saying(event.Listener):
        on_start = on_end = staticmethod(on_event)

    event.register("numba:compile", Saying())  # type: ignore[no-untyped-call]
    return numba


def _folder_of(kernel: _Kernel[Any, Any]) -> str:
    """Return where a compiled function is kept; nothing: nowhere.

    A folder that was open to others once may hold what they put there.
    """
    if (cache := cache_folder()) is None:
        return ""
    made_of = sha256(b"".join(_made_of(kernel, set())))
    folder = cache / made_of.hexdigest()[:16]
    closed = is_own(cache, 0o077)
    there = [folder, *folder.rglob("*")] if folder.exists() else []
    if all(is_own(path, 0 if closed else 0o022) for path in there):
        return str(folder)
    _say_untrusted(cache)
    return ""


@functools.cache
def cache_folder() -> Path | None:
    """Return where compiled code is kept, made if need be; None: nowhere."""
    base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    chosen = os.environ.get("NUMBA_CACHE_DIR") or f"{base}/neurosnap"
    folder = Path(os.path.expanduser(chosen))  # noqa: PTH111 - may fail
    try:
        if folder.is_absolute():
            folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            folder.mkdir(mode=0o700, exist_ok=True)
            if is_own(folder, 0o022):
                return folder
    except OSError:
        pass
    _say_untrusted(folder)
    return None


@functools.cache
def _say_untrusted(folder: Path) -> None:
    """Say that nothing is kept: once, and not in each process that this one starts."""
    from multiprocessing import parent_process

    rule = (
        "must be a folder that this user owns and no other can write to (chmod -R go-w)"
    )
    if parent_process() is None:
        _logger.warning("%s: %s: each start compiles anew", folder, rule)
