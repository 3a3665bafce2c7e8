"""The worlds of tiles as the page draws them, in a real browser."""

import asyncio
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from playwright.async_api import expect

from neurosnap import wire
from neurosnap.agent.continuing import Continuing
from neurosnap.recording.read.recording import Recording
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import recorded
from tests.support.run_options import options_for
from tools.browser import Scheme

pytestmark = IN_BROWSER

TICKS = 30
schemes = pytest.mark.parametrize("scheme", ["light", "dark"])


async def run_of(world: str, folder: Path, **arguments: str) -> Path:
    given: Any = arguments
    options = options_for(world, 5, given, ticks=TICKS, cells="inline")
    return await asyncio.to_thread(recorded, options, folder / "run.mcap")


def states(log: Path, world: str, **arguments: str) -> list[Any]:
    """Return the states of the world at each tick, by taking the same actions in it."""
    given: dict[str, Any] = arguments
    env: Any = Continuing(gymnasium.make(world, **given))
    env.reset(seed=5)
    found = [env.unwrapped.s]
    for each in Recording.open(log).messages(("decide",)):
        assert isinstance(each.message, wire.Decision)
        if each.message.tick and each.message.tick < TICKS:
            env.step(each.message.action)
            found.append(env.unwrapped.s)
    env.close()
    assert len(found) == TICKS
    return found


@schemes
async def test_the_taxi_goes_where_it_went(scheme: Scheme, tmp_path: Path) -> None:
    log = await run_of("neurosnap/Taxi-v0", tmp_path)
    cab: Any = gymnasium.make("neurosnap/Taxi-v0").unwrapped
    stops = ("red", "green", "yellow", "blue")
    async with opened(log, scheme=scheme) as page:
        world = page.locator("#world svg")
        assert await world.locator("rect.place").count() == 25
        assert await world.locator("line.wall").count() == 6
        for tick, state in enumerate(states(log, "neurosnap/Taxi-v0"), start=1):
            await go_to(page, tick)
            row, column, passenger, destination = cab.decode(state)
            said = await world.get_attribute("aria-label") or ""
            assert said.startswith(f"A map of 25 places: at row {row}, column {column}")
            at = "in the taxi" if passenger == 4 else f"at {stops[passenger]}"
            ends = f", passenger {at}, destination {stops[destination]}"
            assert said.endswith(ends)
            agent = world.locator("circle.agent")
            await expect(agent).to_have_attribute("cx", f"{column + 0.5}")
            await expect(agent).to_have_attribute("cy", f"{row + 0.5}")
            assert await world.locator("path.thing").count() == 2
        assert await faults(page) == []


@pytest.mark.parametrize(
    ("world", "tiles"),
    [
        ("neurosnap/FrozenLake-v0", {"hole": 4, "goal": 1, "start": 1, "frozen": 10}),
        ("neurosnap/CliffWalking-v0", {"cliff": 10, "goal": 1, "start": 1}),
    ],
)
async def test_the_walker_goes_where_it_went(
    world: str, tiles: dict[str, int], tmp_path: Path
) -> None:
    log = await run_of(world, tmp_path)
    async with opened(log) as page:
        drawn = page.locator("#world svg")
        for tile, count in tiles.items():
            assert await drawn.locator(f"rect.{tile}").count() == count
        columns = 4 if "Lake" in world else 12
        for tick, state in enumerate(states(log, world), start=1):
            await go_to(page, tick)
            row, column = divmod(int(state), columns)
            agent = drawn.locator("circle.agent")
            await expect(agent).to_have_attribute("cx", f"{column + 0.5}")
            await expect(agent).to_have_attribute("cy", f"{row + 0.5}")
        assert await faults(page) == []


async def test_in_the_maze_the_agent_looks_somewhere(tmp_path: Path) -> None:
    layout = {"layout": "DoorKey-5x5"}
    log = await run_of("neurosnap/MiniGrid-v0", tmp_path, **layout)
    maze: Any = gymnasium.make("neurosnap/MiniGrid-v0", layout="DoorKey-5x5").unwrapped
    turns = {"north": 0, "east": 90, "south": 180, "west": 270}
    async with opened(log) as page:
        drawn = page.locator("#world svg")
        assert await drawn.locator("rect.wall").count() == 18
        for tick, state in enumerate(
            states(log, "neurosnap/MiniGrid-v0", **layout), start=1
        ):
            await go_to(page, tick)
            cell = maze.cells[state]
            turn = f"rotate({turns[cell.facing]})"
            move = f"translate({cell.column + 0.5} {cell.row + 0.5})"
            agent = drawn.locator("path.agent")
            await expect(agent).to_have_attribute("transform", f"{move} {turn}")
            key = "carries the key" if cell.carries == "key" else "key not taken"
            said = f"facing {cell.facing}, door {cell.door}, {key}"
            assert (await drawn.get_attribute("aria-label") or "").endswith(said)
        assert await faults(page) == []


async def test_the_hole_of_the_punctured_grid_is_seen(tmp_path: Path) -> None:
    log = await run_of("neurosnap/PuncturedGrid-v0", tmp_path)
    async with opened(log) as page:
        drawn = page.locator("#world svg")
        assert await drawn.locator("rect.place").count() == 121
        hole = drawn.locator("circle.sign")
        await expect(hole).to_have_attribute("cx", "5.5")
        await expect(hole).to_have_attribute("cy", "5.5")
