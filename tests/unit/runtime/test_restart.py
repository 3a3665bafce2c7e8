"""A run that goes on after a death, and is told to end meanwhile."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from shutil import copy

import pytest

from neurosnap.errors import PartDiedError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime import restart
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.restart_policy import Supervision
from neurosnap.runtime.run import Outcome, run
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
    outcome = await run(options, whole, asyncio.Event())
    stop, asked = asyncio.Event(), asyncio.Event()
    loop, heeded = asyncio.get_running_loop(), []
    have_left = RestartFiles.have_left

    def look(lives: RestartFiles, tick: int) -> bool:
        found = have_left(lives, tick)
        loop.call_soon_threadsafe(asked.set)
        return found

    async def one_life(
        options: RunOptions,
        log: Path,
        stop: asyncio.Event,
        follow: Callable[[int], None],
        *_: object,
        incarnation: int,
        **__: object,
    ) -> Outcome:
        if incarnation == 0:
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
        follow(TICKS)
        await stop.wait()
        return outcome

    monkeypatch.setattr(RestartFiles, "have_left", look)
    monkeypatch.setattr(restart, "run", one_life)
    async with asyncio.timeout(PATIENCE):
        found = await restart.run_with_restarts(
            options,
            log,
            stop,
            Supervision(backoff=0),
            on_restart=lambda _: stop.set(),
        )
    assert heeded == [not had]
    assert (found.restarts, found.kept) == (1, ())
    assert names(tmp_path) == [log.name, whole.name]


@pytest.mark.parametrize("deaths", [1, 2])
async def test_told_to_end_while_a_part_dies_a_run_has_one_more_life(
    deaths: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, whole = tmp_path / "run.mcap", tmp_path / "whole.mcap"
    options = options_of(TICKS)
    outcome = await run(options, whole, asyncio.Event())
    stop = asyncio.Event()

    async def one_life(
        options: RunOptions, log: Path, *_: object, incarnation: int, **__: object
    ) -> Outcome:
        stop.set()
        if incarnation < deaths:
            raise PartDiedError("hub: must live, died")
        copy(whole, log)
        return outcome

    monkeypatch.setattr(restart, "run", one_life)
    running = restart.run_with_restarts(options, log, stop, Supervision(backoff=0))
    async with asyncio.timeout(PATIENCE):
        if deaths == 1:
            assert (await running).restarts == 1
        else:
            with pytest.raises(PartDiedError, match=r"^hub: must live"):
                await running
