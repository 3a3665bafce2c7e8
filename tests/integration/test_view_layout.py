"""Where sensors stand follows from the order alone, and what moves glides."""

from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page

from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.recorded_runs import TICKS

pytestmark = IN_BROWSER

WAYS = [[1, 5, 9, 14, 20], [TICKS, 3, 20], [20, 21, 22, 20]]


async def places(page: Page, tick: int) -> dict[str, Any]:
    """Return where each sensor stands, and is seen, at a tick."""
    await go_to(page, tick)
    found: dict[str, Any] = await page.evaluate(
        """async (tick) => {
            const { page } = await import("/main.js");
            const { diagram } = page;
            const frame = () => new Promise(requestAnimationFrame);
            while (page.frame.tick !== tick || page.graph?.id !== page.frame.graph
                || diagram._graph?.id !== page.graph.id
                || diagram._places !== diagram._laid.places) await frame();
            const found = {};
            for (const [key, place] of diagram._laid.places) {
                found[key] = [place.x, place.y, diagram._camera.over(place)];
            }
            return found;
        }""",
        tick,
    )
    return found


@pytest.mark.parametrize("name", ["csv", "planner"])
async def test_it_is_the_same_whichever_way_one_came(
    name: str, csv_log: Path, planner_log: Path
) -> None:
    log = {"csv": csv_log, "planner": planner_log}[name]
    async with opened(log, "#t=20") as page:
        expected = await places(page, 20)
    assert len(expected) > 1
    others = []
    for way in WAYS:
        async with opened(log, f"#t={way[0]}") as page:
            seen = [await places(page, tick) for tick in way]
        assert seen[-1] == expected
        others += seen
    assert any(other != expected for other in others)


@pytest.mark.parametrize("still", [False, True])
async def test_what_moves_glides_unless_one_wants_no_motion(
    planner_log: Path, still: bool
) -> None:
    async with opened(planner_log, "#t=1", still=still) as page:
        await places(page, 1)
        shown = await page.evaluate(
            """async () => {
                const { Glide } = await import("/order/glide.js");
                const at = (x) => new Map([["s0", { x, y: 0 }], ["s1", { x: 5, y: 5 }]]);
                const seen = [];
                await new Promise((done) => {
                    const glide = new Glide((places) => {
                        seen.push(places.get("s0").x);
                        if (places.get("s0").x === 100) done();
                    });
                    glide.start(new Map([["s0", { x: 0, y: 0 }]]), at(100));
                });
                return seen;
            }"""
        )
    assert shown == sorted(shown)
    assert shown[-1] == 100
    assert shown[0] == (100 if still else 0)
    assert (len(shown) == 1) == still
