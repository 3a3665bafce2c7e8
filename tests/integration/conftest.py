"""Read-only recordings and keys shared by several integration tests."""

import fcntl
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest
import pytest_asyncio
from msgspec.structs import replace
from playwright.async_api import expect

from neurosnap.fabric.certificates import make_keys
from tests.support import browser_pages as pages
from tests.support import preloaded
from tests.support.home_runs import broken_home
from tests.support.lamp import lamp_options
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import (
    csv_run,
    large_run,
    path_run,
    planner_run,
    recorded,
    torn_run,
    unread_run,
)
from tools.browser import started


def passing() -> set[psutil.Process]:
    """Return the processes below this one, except those that stay."""
    found: set[psutil.Process] = set()
    for child in psutil.Process().children():
        with suppress(psutil.NoSuchProcess):  # it has ended meanwhile
            command = " ".join(child.cmdline())
            if "resource_tracker" not in command:
                found.update(child.children(recursive=True))
                if "forkserver" not in command:
                    found.add(child)
    return found


def _once(make: Callable[[Path], Path]) -> Any:
    """Return a fixture: the recording that one worker makes for all of them."""

    @pytest.fixture(scope="session")
    def log(
        request: pytest.FixtureRequest,
        tmp_path_factory: pytest.TempPathFactory,
        worker_id: str,
    ) -> Path:
        base = tmp_path_factory.getbasetemp()
        shared = base if worker_id == "master" else base.parent
        folder = shared / str(request.fixturename)
        made = folder / "made"
        with (shared / f"{folder.name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not made.exists():
                folder.mkdir()
                made.write_text(str(make(folder)))
        return Path(made.read_text())

    return log


path_log = _once(lambda at: recorded(path_run(), at / "path.mcap"))
planner_log = _once(lambda at: recorded(planner_run(), at / "planner.mcap"))
csv_log = _once(lambda at: recorded(csv_run(at / "readings.csv"), at / "csv.mcap"))
unread_log = _once(lambda at: unread_run(at / "unread.mcap"))
torn_log = _once(lambda at: torn_run(at / "torn.mcap"))
lamp_log = _once(
    lambda at: recorded(lamp_options(ticks=60, cells="inline"), at / "lamp.mcap")
)
home_log = _once(broken_home)
large_log = _once(lambda at: recorded(large_run(at / "rows.csv"), at / "large.mcap"))


@pytest.fixture(scope="session")
def broken_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of 60 ticks in which a rule is broken, first at tick 25."""
    folder = tmp_path_factory.mktemp("broken")
    options = replace(csv_run(folder / "rows.csv", 60), watch=True, support=2)
    return recorded(options, folder / "run.mcap")


@pytest.fixture(scope="session")
def role_keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The keys of a swarm, a certificate a role; nobody writes to them."""
    folder = tmp_path_factory.mktemp("security") / "keys"
    make_keys(folder)
    return folder


@pytest.fixture
def endpoint() -> Iterator[str]:
    """Where a hub may listen: a socket's path may have some hundred characters."""
    with tempfile.TemporaryDirectory(prefix="ns-") as folder:
        yield f"unixsock-stream/{folder}/hub"


@pytest.fixture(autouse=True)
def own_notes(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Let tests that run at the same time give their swarms the same name."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))


@pytest.fixture
def no_process_is_left() -> Iterator[None]:
    """Fail if a process outlives the test."""
    before = passing()
    yield
    # The fork server may yet have to reap one.
    _, alive = psutil.wait_procs(passing() - before, timeout=PATIENCE)
    assert alive == []


@pytest.fixture(scope="session", autouse=True)
def fork_server() -> None:
    preloaded.start()


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def browser() -> AsyncIterator[None]:
    """A browser for all tests, which open pages of their own."""
    expect.set_options(timeout=PATIENCE * 1000)
    async with started() as browser:
        pages.shared.append(browser)
        pages.servers.append(pages.KeptServers())
        yield
        await pages.kept_open.aclose()
        await pages.servers.pop().end()
        pages.kept.clear()
        pages.shared.clear()
