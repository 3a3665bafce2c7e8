"""A world that hangs is named, and the run goes on with another."""

import asyncio
import contextlib
import re
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import pytest

from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime import remote_parts
from neurosnap.runtime.network import Network
from neurosnap.runtime.request import RunRequest, Site, Supervision, Watcher
from neurosnap.runtime.run import run
from neurosnap.runtime.service import serve
from tests.support.disturbed_runs import (
    ENDLESS,
    Disturbed,
    options_for,
    parts,
)
from tests.support.hanging_worlds import SILENT, ending_world
from tests.support.ports import free_port

if TYPE_CHECKING:
    import psutil

    from neurosnap.runtime.request import Restart

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]

SWARM = "demo"


def endpoint() -> str:
    """Where a hub may listen now."""
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def hanging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunOptions:
    """A run whose world is there and says no more after tick 6."""
    options = ending_world(tmp_path, monkeypatch, "threading.Event().wait()")
    return msgspec.structs.replace(options, deadline=1.0)


@pytest.mark.parametrize(("restart", "times"), [("never", 0), ("on-failure", 1)])
def test_a_world_that_hangs_is_named_and_treated_like_one_that_died(
    restart: str, times: int, hanging: RunOptions, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(hanging, log, restart=restart, max_restarts=1)
    with pytest.raises(PartDiedError, match=SILENT):
        disturbed.run()
    assert [event.tick for event in disturbed.restarts] == [6] * times
    assert verify(log).ticks == 6


def test_a_run_whose_world_is_held_goes_on_with_another(tmp_path: Path) -> None:
    options = msgspec.structs.replace(options_for(ENDLESS), deadline=1.0)
    held: list[psutil.Process] = []
    restarts: list[Restart] = []
    stop = asyncio.Event()

    def hold(tick: int) -> None:
        if not held and tick > 50:
            held.extend(one for one in parts() if one.name() == "world")
            held[0].send_signal(signal.SIGSTOP)
        elif restarts and tick > restarts[0].tick:
            stop.set()

    log = tmp_path / "log"
    request = RunRequest(options, log, supervision=Supervision())
    running = run(request, stop, Watcher(hold, on_restart=restarts.append))
    outcome = asyncio.run(running)
    said = r"^coordinator: world: must answer the decision of tick \d+ within 3 s"
    assert re.search(said, restarts[0].why)
    assert outcome.restarts == len(restarts)
    verdict = verify(log)
    assert verdict.same
    assert verdict.complete


def test_a_world_elsewhere_that_hangs_is_named(
    hanging: RunOptions, tmp_path: Path
) -> None:
    where, stop = endpoint(), asyncio.Event()

    async def elsewhere() -> None:
        world, network = remote_parts.world(hanging.source), Network(connect=where)
        with contextlib.suppress(SwarmError):  # it will not end when it is asked to
            await serve(world, network, SWARM, stop, restart="never")

    async def both() -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(elsewhere())
            try:
                await Disturbed(hanging, tmp_path / "log", restart="never").running(
                    site=Site(
                        Network(listen=where),
                        swarm=SWARM,
                        elsewhere=frozenset({"world"}),
                    ),
                )
            finally:
                stop.set()

    with pytest.raises(ExceptionGroup) as raised:
        asyncio.run(both())
    (error,) = raised.value.exceptions
    assert isinstance(error, SwarmError)
    assert re.search(SILENT, str(error))
