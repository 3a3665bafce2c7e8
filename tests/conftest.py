"""Shared test settings, and checks that no test leaves anything running.

After every test none of its threads and tasks is alive, and nothing was logged as an
error by `zenoh.handlers`, which is where an exception in one of Zenoh's callbacks goes.
"""

import asyncio
import gc
import inspect
import logging
import os
import threading
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
import pytest_asyncio

from neurosnap.recording.write.rotation import Split
from neurosnap.runtime.parts import recorder_process
from tests.support import hypothesis_settings

pytest_plugins = [
    "tests.support.no_skips",
    "tests.support.processor_time",
    "pytester",
]

hypothesis_settings.register()
# Ray reads them when it is imported, and so do the commands that tests start. Without
# the first it takes the machine's own address for 127.0.0.1; with the second it reports
# nothing to anybody.
os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"


def pytest_collection_finish() -> None:
    """Spare the garbage collector what lasts: six thousand tests, and all modules."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def many_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each key-frame of a run begin another file of its recording."""
    monkeypatch.setattr(recorder_process, "split_of", lambda _: Split(1))


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    """Fail if a thread outlives the test.

    Asyncio's executor needs no exception: this comes first, so it looks once the loop
    has closed. Neither does Zenoh: its own threads are not Python's, except that Python
    makes a lasting dummy of one that ever asks for its name, and those cannot be ended.
    """
    before = set(threading.enumerate())
    yield
    left = [
        thread
        for thread in threading.enumerate()
        if thread not in before and not isinstance(thread, threading._DummyThread)
    ]
    for thread in left:
        thread.join(0.5)  # it may be about to end
    names = [thread.name for thread in left if thread.is_alive()]
    assert not names, f"threads that outlived the test: {', '.join(names)}"


@pytest.fixture(autouse=True)
def no_task_is_left(request: pytest.FixtureRequest, no_thread_is_left: None) -> None:
    """Fail if a task outlives an asynchronous test."""
    if inspect.iscoroutinefunction(getattr(request, "function", None)):
        mark = request.node.get_closest_marker("asyncio")
        shared = mark is not None and mark.kwargs.get("loop_scope") == "session"
        name = "_shared_loop_is_as_before" if shared else "_loop_is_empty"
        request.getfixturevalue(name)


@pytest.fixture
async def _loop_is_empty() -> AsyncIterator[None]:
    yield
    await _fail_if_left(set())


@pytest_asyncio.fixture(loop_scope="session")
async def _shared_loop_is_as_before() -> AsyncIterator[None]:
    # Asyncio's own would last as long as the loop.
    executor = ThreadPoolExecutor()
    asyncio.get_running_loop().set_default_executor(executor)
    before = asyncio.all_tasks()
    yield
    await _fail_if_left(before)
    executor.shutdown()


async def _fail_if_left(before: set[asyncio.Task[Any]]) -> None:
    # What was cancelled in the test's last step gets the turns it needs to end.
    for _ in range(5):
        await asyncio.sleep(0)
    left = asyncio.all_tasks() - before - {asyncio.current_task()}
    names = sorted(task.get_name() for task in left)
    assert not names, f"tasks that outlived the test: {', '.join(names)}"


class _Kept(logging.Handler):
    """Keeps what it is given."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


@pytest.fixture(autouse=True)
def no_callback_fails(no_thread_is_left: None) -> Iterator[None]:
    """Fail if one of Zenoh's callbacks raised: that is only logged."""
    kept = _Kept()
    logger = logging.getLogger("zenoh.handlers")
    logger.addHandler(kept)
    yield
    logger.removeHandler(kept)
    said = [record.getMessage() for record in kept.records]
    assert not said, f"errors in Zenoh's callbacks: {said}"
