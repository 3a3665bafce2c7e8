"""Words that explain themselves, what a page begins with, and what a tick taught."""

from pathlib import Path

import pytest
from playwright.async_api import expect

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_difference import difference
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.page_faults import faults
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_a_word_is_explained_by_pointer_keyboard_and_touch(
    planner_log: Path, scheme: Scheme
) -> None:
    async with opened(planner_log, "#t=30", scheme) as page:
        await wait_shown(page, 30)
        tip = page.locator("#tip")
        height = page.locator("#now .term", has_text="height")
        await height.hover()
        await expect(tip).to_contain_text("longest chain of implications")
        assert await faults(page) == []
        await tip.hover()  # one may read it at leisure
        await expect(tip).to_be_visible()
        await page.mouse.move(400, 400)
        await expect(tip).to_be_hidden()
        await height.focus()
        await expect(tip).to_be_visible()
        assert await height.get_attribute("aria-describedby") == "tip"
        await page.keyboard.press("Escape")
        await expect(tip).to_be_hidden()


async def test_every_word_that_is_marked_is_explained(planner_log: Path) -> None:
    async with opened(planner_log, "#t=30") as page:
        await wait_shown(page, 30)
        await page.click("#tab-sensors")
        await page.locator("#outline th[scope=row] button").first.click()
        await page.locator("#choice .edges button").first.click()
        await page.wait_for_selector("#choice .term")
        marked = await page.locator(".term").evaluate_all(
            "(all) => all.map((one) => one.dataset.term)"
        )
        known = await page.evaluate(
            "import('/base/terms.js').then(({ TERMS }) => Object.keys(TERMS))"
        )
        assert len(set(marked)) > 20
        assert set(marked) <= set(known)
        await page.click("#help")
        assert await page.locator("#words-list dt").all_inner_texts() == known
        assert await faults(page) == []


async def test_without_a_link_it_begins_with_a_wave_that_goes_deep(
    planner_log: Path,
) -> None:
    frames = RunView(planner_log).frames(1, 60)
    depths = [max(wave.depth for wave in frame.waves) for frame in frames]
    deepest = frames[depths.index(max(depths))]
    assert max(depths) > 2
    async with opened(planner_log) as page:
        await wait_shown(page, deepest.tick)
        most = await page.get_attribute("#wave-hop", "max")
        assert int(most or 0) == max(depths)


async def test_what_a_tick_taught_is_said_and_can_be_looked_at(path_log: Path) -> None:
    view = RunView(path_log)
    taught = [(tick, difference(view, tick, view, tick - 1)) for tick in range(2, 20)]
    tick, found = next(one for one in taught if one[1].here.edge_count)
    still = next(
        tick
        for tick, one in taught
        if not (one.here.edge_count + one.there.edge_count)
        and not (one.here.class_count + one.there.class_count)
    )
    more = found.here.edge_count + found.here.class_count
    fewer = found.there.edge_count + found.there.class_count
    async with opened(path_log, f"#t={tick}") as page:
        await wait_shown(page, tick)
        changed = page.locator("#order-changed")
        both = " ".join([f"+{more}"] * (more > 0) + [f"−{fewer}"] * (fewer > 0))
        await expect(changed).to_have_text(f"{both} at this tick")
        await changed.click()
        await expect(page.locator("#compare")).to_contain_text(
            f"Implied at tick {tick}, not at tick {tick - 1} {found.here.edge_count}"
        )
        await go_to(page, still)
        await expect(changed).to_be_hidden()


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ("is:predicted", ["s1"]),
        ("is:on", ["s0", "s1"]),
        ("is:unknown", ["s2"]),
        ("reads:unknown", ["s1", "s2"]),
        ("reads:unknown is:on", ["s1"]),
        ("s2 is:on", []),
    ],
)
async def test_sensors_are_found_by_what_is_believed_and_read(
    unread_log: Path, asked: str, found: list[str]
) -> None:
    async with opened(unread_log, "#t=31") as page:
        await wait_shown(page, 31)
        await page.fill("#search-text", asked)
        said = f"{len(found)} found" if found else "none"
        await expect(page.locator("#search-found")).to_have_text(said)
        for name in found:
            await page.press("#search-text", "Enter")
            await expect(page.locator("#choice-title")).to_have_text(name)
        await page.fill("#search-text", "is:warm")
        await expect(page.locator("#search-found")).to_contain_text(
            "is: one of on, off"
        )


async def test_a_tick_without_a_decision_is_not_said_to_do_nothing(
    path_log: Path, csv_log: Path
) -> None:
    last = RunView(path_log).last
    async with opened(path_log, f"#t={last - 1}") as page:
        await wait_shown(page, last - 1)
        did = page.locator("#now dd").first
        await expect(did).not_to_contain_text("not decided")
    async with opened(csv_log, "#t=9") as page:
        await wait_shown(page, 9)
        facts = await page.locator("#now dt").all_inner_texts()
        assert "did" not in facts  # nobody decides anything
        assert "why" not in facts
