"""A run that is told to end while it restarts after a part died."""

import asyncio
from pathlib import Path
from shutil import copy

import pytest

from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime import run_with_restarts as restart
from neurosnap.runtime.request import Outcome, RunRequest, Supervision, Watcher
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.run_with_restarts import Lives, Restarts, run
from tests.support.restart_runs import names, options_of

TICKS = 12
PATIENCE = 60.0


@pytest.mark.parametrize("had", [TICKS, 0], ids=["cut off", "nothing begun"])
async def test_a_tick_that_was_cut_off_is_done_again_before_the_end(
    had: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`had` ticks are recorded when a part dies; the last is not a whole one."""
    log, whole = tmp_path / "run.mcap", tmp_path / "whole.mcap"
    options = options_of(TICKS)
    outcome = await run(RunRequest(options, whole), asyncio.Event())
    stop, asked = asyncio.Event(), asyncio.Event()
    loop, heeded = asyncio.get_running_loop(), []
    have_left = RestartFiles.have_left

    def look(lives: RestartFiles, tick: int) -> bool:
        found = have_left(lives, tick)
        loop.call_soon_threadsafe(asked.set)
        return found

    async def one_life(
        request: RunRequest, stop: asyncio.Event, watcher: Watcher
    ) -> Outcome:
        if request.site.incarnation == 0:
            if had:
                copy(whole, log)
            raise PartDiedError("cell/0: must live, died")
        await asked.wait()
        if not had:
            await stop.wait()
        for _turn in range(20):
            await asyncio.sleep(0)
        heeded.append(stop.is_set())
        copy(whole, log)
        watcher.on_tick(TICKS)
        await stop.wait()
        return outcome

    monkeypatch.setattr(RestartFiles, "have_left", look)
    monkeypatch.setattr(restart, "run_incarnation", one_life)
    async with asyncio.timeout(PATIENCE):
        found = await Lives(
            RunRequest(options, log, supervision=Supervision(backoff=0)),
            Watcher(on_restart=lambda _: stop.set()),
        ).run(stop)
    assert heeded == [not had]
    assert (found.restarts, found.kept) == (1, ())
    assert names(tmp_path) == [log.name, whole.name]


@pytest.mark.parametrize("deaths", [1, 2])
async def test_told_to_end_while_a_part_dies_a_run_has_one_more_life(
    deaths: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, whole = tmp_path / "run.mcap", tmp_path / "whole.mcap"
    options = options_of(TICKS)
    outcome = await run(RunRequest(options, whole), asyncio.Event())
    stop = asyncio.Event()

    async def one_life(request: RunRequest, *_: object) -> Outcome:
        stop.set()
        if request.site.incarnation == 0:
            copy(whole, log)
        if request.site.incarnation < deaths:
            raise PartDiedError("hub: must live, died")
        copy(whole, log)
        return outcome

    monkeypatch.setattr(restart, "run_incarnation", one_life)
    request = RunRequest(options, log, supervision=Supervision(backoff=0))
    running = Lives(request, Watcher()).run(stop)
    async with asyncio.timeout(PATIENCE):
        if deaths == 1:
            assert (await running).restarts == 1
        else:
            with pytest.raises(PartDiedError, match=r"^hub: must live"):
                await running
    # Given up before a tick of its own, it keeps what there was.
    assert verify(log).ticks == TICKS
    assert names(tmp_path) == [log.name, whole.name]


# How often and when -------------------------------------------------------------------

DIED = PartDiedError("cell/1: was killed")


def test_restarts_count_only_for_a_while() -> None:
    restarts = Restarts(Supervision(max_restarts=2, restart_window=60.0))
    assert [restarts.allow(DIED, 100.0) for _ in range(3)] == [True, True, False]
    assert not restarts.allow(DIED, 159.0)
    assert [restarts.allow(DIED, 160.0) for _ in range(3)] == [True, True, False]


def test_which_errors_are_mended_is_the_policys_to_say() -> None:
    said = SwarmError("world: the source is gone")
    for policy, mended in (
        (Supervision(max_restarts=0, restart_on_error=True), []),
        (Supervision(), [DIED]),
        (Supervision(restart_on_error=True), [DIED, said]),
    ):
        restarts = Restarts(policy)
        assert [error for error in (DIED, said) if restarts.allow(error, 0.0)] == mended


def test_without_a_tick_in_between_each_delay_is_twice_the_last() -> None:
    restarts = Restarts(Supervision(backoff=1.0))
    assert [restarts.delay(gained=False) for _ in range(6)] == [2, 4, 8, 16, 30, 30]
    assert restarts.delay(gained=True) == 1
    assert restarts.delay(gained=False) == 2
