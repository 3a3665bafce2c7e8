"""Serves the page of ``neurosnap view``, alone or beside a run."""

import asyncio
import contextlib
import ctypes
import importlib.util
import webbrowser
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import typer

from neurosnap.apps.cli.terminal_output import print_json
from neurosnap.errors import InvalidValueError, MissingExtraError, RecordingError
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.system.distribution import must_have

T = TypeVar("T")
_POLL = 0.1
"""Seconds between two looks for a recording that is to begin."""
_NEEDED = ("starlette", "uvicorn")
_MALLOPT = (-8, 1), (-3, 1 << 18)
"""One arena for all threads, and pages of their own for large arrays, of which the
process else keeps what is freed: M_ARENA_MAX and M_MMAP_THRESHOLD."""


def check_page() -> None:
    """Raise MissingExtraError if what serves the page is not installed."""
    for package in _NEEDED:
        if importlib.util.find_spec(package) is None:
            raise MissingExtraError(f"view: {must_have(package, 'view')}")


async def look(
    logs: Sequence[Path],
    stop: asyncio.Event,
    *,
    port: int = 0,
    browser: bool = True,
    grows: Callable[[], bool] | None = None,
    as_json: bool = False,
) -> None:
    """Serve a page for recordings until `stop` is set, and say where it is.

    Args:
        logs: The recordings, one or more; the page opens with the first.
        stop: Ends it.
        port: 0: any that is free.
        browser: Whether to open it.
        grows: Says whether they are still being written; None: whether a process of
            this machine holds each. As long as one is, its beginning is waited for.
        as_json: Say where as JSON.

    Raises:
        InvalidValueError: A recording is named twice.
        NeurosnapError: A recording cannot be read, the port cannot be used, or what
            serves the page is not installed.
    """
    check_page()
    with contextlib.suppress(AttributeError):  # of glibc alone
        for setting in _MALLOPT:
            ctypes.CDLL(None).mallopt(*setting)
    from neurosnap.apps.viewer.opened_recording import ViewSession
    from neurosnap.apps.viewer.server import serving
    from neurosnap.runtime.registry import is_held

    sessions: list[ViewSession] = []
    for number, log in enumerate(logs):
        if log.resolve() in {other.resolve() for other in logs[:number]}:
            raise InvalidValueError("log", "must be named once", str(log))
        writes = grows or partial(is_held, log)
        opened = partial(ViewSession, log, writes)
        sessions.append(await _begun(opened, writes, stop))
    async with serving(*sessions, port=port) as address:
        # Not through what folds lines: it is to be copied whole.
        if as_json:
            named = {"log": str(logs[0]), "logs": [str(log) for log in logs]}
            print_json({**named, "url": address.url})
        else:
            for number, log in enumerate(logs):
                shown = f"#run={number}" if number else ""
                typer.echo(f"{log}: {address.url}{shown}")
        if browser:
            with contextlib.suppress(webbrowser.Error):
                await asyncio.to_thread(webbrowser.open, address.url)
        await stop.wait()


async def _begun(
    opened: Callable[[], T], grows: Callable[[], bool], stop: asyncio.Event
) -> T:
    """Return what `opened` does, as soon as the recording has begun."""
    while True:
        last = stop.is_set() or not grows()
        try:
            return await asyncio.to_thread(opened)
        except RecordingError:
            if last:
                raise
        await wait_any(stop, seconds=_POLL)


async def viewed(
    log: Path,
    stop: asyncio.Event,
    work: Callable[[asyncio.Event], Coroutine[Any, Any, T]],
    on_end: Callable[[T], None],
) -> T:
    """Do what writes a recording, and let it be looked at: then, and until `stop`.

    Args:
        log: Where it records.
        stop: Ends both.
        work: Returns once `log` is whole.
        on_end: Given the result, while the page is still there.

    Raises:
        NeurosnapError: As from `work` or from `look`; either ends the other.
    """
    halt = asyncio.Event()
    running = asyncio.create_task(work(stop), name="view/run")
    page = asyncio.create_task(
        look([log], halt, grows=lambda: not running.done()),
        name="view/page",
    )
    try:
        await asyncio.wait({running, page}, return_when=asyncio.FIRST_COMPLETED)
        if page.done():
            stop.set()
        outcome = await running
        on_end(outcome)
        await stop.wait()
    finally:
        halt.set()
        stop.set()
        await asyncio.wait({running, page})
        failed = page.exception()
    if failed is not None:
        raise failed
    return outcome
