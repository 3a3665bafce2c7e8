"""What the page says and draws of what was read against what is believed.

Every test also holds that nothing was fetched from elsewhere, and that nothing failed.
"""

from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import (
    named_run,
    recorded,
)
from tools.browser import Scheme, wait_shown

pytestmark = IN_BROWSER

LONG = "binary_sensor." + "_".join(f"part_{k}_of_a_long_name" for k in range(6))

LOOK = """async ([sensor]) => {
    const { diagram } = (await import("/main.js")).page;
    const { looks } = await import("/order/looks.js");
    const item = diagram._drawing.itemOf[sensor];
    const { condition, reads, predicted } = looks(diagram._frame, null, null, null)(item);
    const place = diagram._laid.places.get(item.key);
    const { x, y } = diagram._camera.over(place);
    const context = diagram._layers.nodes;
    const { scale } = diagram._camera;
    const half = { own: -place.width / 2 + 9, cap: place.width / 2 - 3 };
    const rows = Array.from({ length: 11 }, (_, k) => k - 5);
    const all = document.createElement("canvas");
    [all.width, all.height] = [context.canvas.width, context.canvas.height];
    const read = all.getContext("2d", { willReadFrequently: true });
    read.drawImage(context.canvas, 0, 0);
    const ink = (across) => rows.map((down) =>
        [...read.getImageData(x + across * scale, y + down * scale, 1, 1).data].join());
    return { condition, reads, predicted, own: ink(half.own), cap: ink(half.cap) };
}"""


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("long")
    return recorded(named_run(folder / "readings.csv", LONG), folder / "long.mcap")


async def told(page: Page, sensor: int) -> tuple[str, str, str]:
    """Return what the table says: the reading, the state, and what is believed why."""
    row = page.locator("#outline tbody tr").nth(sensor)
    reads, state, belief = [
        await row.locator(f"td.{what}").inner_text()
        for what in ("reads", "state", "belief")
    ]
    return reads, state, belief


async def test_each_kind_of_belief_is_said_in_the_table_and_at_the_node(
    unread_log: Path,
) -> None:
    async with opened(unread_log, "#t=30") as page:
        await wait_shown(page, 30)
        await page.click("#tab-sensors")
        assert await told(page, 0) == ("on", "on", "read")
        assert await told(page, 1) == ("on", "on", "read")
        await go_to(page, 31)
        assert await told(page, 0) == ("on", "on", "read")
        predicted = ("unknown", "on", "predicted: not read; s0 says on")
        assert await told(page, 1) == predicted
        assert await told(page, 2) == ("unknown", "unknown", "unknown")
        await go_to(page, 32)
        broken = ("off", "contradicted", "contradicted: reads off; s0 says on")
        assert await told(page, 1) == broken
        box = await page.locator("#drawing").bounding_box()
        place = await page.evaluate(
            """async () => {
                const { diagram } = (await import("/main.js")).page;
                return diagram._camera.over(diagram._laid.places.get("s1"));
            }"""
        )
        assert box is not None
        await page.mouse.move(box["x"] + place["x"], box["y"] + place["y"])
        await expect(page.locator("#drawing")).to_have_attribute(
            "title", "s1: reads off; s0 says on"
        )


async def test_each_kind_of_belief_is_drawn_otherwise(unread_log: Path) -> None:
    drawn = {}
    async with opened(unread_log, "#t=30") as page:
        for tick, sensor in ((30, 1), (31, 1), (31, 2), (32, 1)):
            await go_to(page, tick)
            drawn[tick, sensor] = await page.evaluate(LOOK, [sensor])
    read, predicted, unknown, broken = drawn.values()
    assert len(set(read["own"])) == 1  # filled
    assert len(set(predicted["own"])) > 2  # hatched
    assert len(set(unknown["own"])) == 1  # empty
    assert unknown["own"] != read["own"]
    assert broken["cap"] != read["cap"]
    asked = ("condition", "reads", "predicted")
    assert [tuple(each[what] for what in asked) for each in drawn.values()] == [
        ("on", 1, False),
        ("on", None, True),
        ("unknown", None, False),
        ("contradicted", 0, False),
    ]


async def test_what_is_contradicted_is_counted_in_what_is_folded(
    large_log: Path,
) -> None:
    async with opened(large_log, "#t=6") as page:
        await wait_shown(page, 6)
        counted = await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const { looks } = await import("/order/looks.js");
                const { diagram, frame } = page;
                const wrong = frame.contradicted[0] ?? 0;
                frame.contradicted = [wrong, wrong + 1, wrong + 2];
                const own = diagram._drawing.items.filter(({ kind }) => kind !== "sensor");
                const look = looks(frame, null, null, null);
                return own.map((item) => [
                    look(item).counts, item.sensors.length,
                    item.sensors.filter((each) => frame.contradicted.includes(each)).length,
                    diagram._on.tell(item),
                ]);
            }"""
        )
    assert counted
    for counts, sensors, wrong, tip in counted:
        assert sum(counts.values()) == sensors
        assert counts["contradicted"] == wrong
        assert (f"{wrong} contradicted" in tip) == (wrong > 0)
    assert sum(each[2] for each in counted) > 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_axe_finds_no_fault_in_any_kind_of_belief(
    scheme: Scheme, unread_log: Path
) -> None:
    async with opened(unread_log, "#t=31", scheme) as page:
        for tick in (31, 32):
            await go_to(page, tick)
            await page.click("#tab-sensors")
            await page.locator("#outline tbody button").nth(1).click()
            assert await faults(page) == []


async def test_a_name_of_any_length_leaves_room_for_the_rest(long_log: Path) -> None:
    async with opened(long_log, "#t=6") as page:
        await wait_shown(page, 6)
        widths, name_shown = await page.evaluate(
            """async () => {
                const { page } = await import("/main.js");
                const { shortened } = await import("/order/nodes.js");
                const places = [...page.diagram._laid.places.values()];
                return [places.map(({ width }) => width), shortened(page.names[0])];
            }"""
        )
        assert max(widths) < 260
        assert name_shown.startswith("binary_sensor")
        assert name_shown.endswith(LONG[-13:])
        await page.click("#tab-sensors")
        row = page.locator("#outline tbody tr").first
        button = row.locator("button")
        await expect(button).to_have_attribute("title", LONG)
        place = await button.bounding_box()
        assert place is not None
        assert place["width"] < 300


async def test_a_complement_is_tied_by_another_line_than_an_equal(
    csv_log: Path,
) -> None:
    async with opened(csv_log) as page:
        painted = await page.evaluate(
            """async () => {
                const { paintClasses } = await import("/order/background.js");
                const strokes = (turned) => {
                    let count = 0;
                    const context = {
                        beginPath() {}, moveTo() {}, lineTo() {}, stroke() { count += 1; },
                    };
                    const item = (turned) => ({ kind: "sensor", class: 0, turned });
                    paintClasses(context, new Map([
                        ["a", { x: 0, y: 0, width: 50, item: item(false) }],
                        ["b", { x: 90, y: 0, width: 50, item: item(turned) }],
                    ]), {});
                    return count;
                };
                return [strokes(false), strokes(true)];
            }"""
        )
    assert painted == [2, 3]
