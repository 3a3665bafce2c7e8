"""The files that the page gives: pictures of the order, and tables."""

import csv
import io
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import image
from numpy.typing import NDArray
from playwright.async_api import Page, expect

from neurosnap.apps.viewer.conditions import OFF, ON
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.system.csv_text import as_text
from tests.support.browser_pages import IN_BROWSER, opened, shared
from tests.support.recorded_runs import TICKS
from tools.browser import Scheme, new_page, wait_shown

pytestmark = IN_BROWSER

SVG = "{http://www.w3.org/2000/svg}"
READ = 31  # of the run with silent sensors: one is predicted, one unknown


async def saved(page: Page, button: str, folder: Path) -> Path:
    """Click a button and keep the file it gives."""
    async with page.expect_download() as coming:
        await page.click(button)
    download = await coming.value
    path = folder / download.suggested_filename
    await download.save_as(path)
    return path


async def painted(svg: Path, scheme: Scheme) -> NDArray[np.float32]:
    """Return what a browser paints of an SVG file, two dots for each unit."""
    root = ElementTree.parse(svg).getroot()
    width, height = float(root.get("width", "0")), float(root.get("height", "0"))
    async with new_page(shared[-1], scheme) as page:
        size = {"width": round(2 * width), "height": round(2 * height)}
        await page.set_viewport_size(size)  # type: ignore[arg-type]
        await page.goto(svg.as_uri())
        # As large as the PNG is.
        await page.evaluate(
            """({ width, height }) => {
                document.documentElement.setAttribute("width", width);
                document.documentElement.setAttribute("height", height);
            }""",
            size,
        )
        return image.imread(io.BytesIO(await page.screenshot()))[..., :3]


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_both_pictures_show_the_same(
    planner_log: Path, unread_log: Path, tmp_path: Path, scheme: Scheme
) -> None:
    for log, tick in [(planner_log, TICKS), (unread_log, READ)]:
        async with opened(log, f"#t={tick}", scheme) as page:
            await wait_shown(page, tick)
            await page.keyboard.press("w")  # a wave on its way, where there is one
            await page.locator("#wave-hop").fill("0.5")
            await page.keyboard.press("w")
            svg = await saved(page, "#save-svg", tmp_path)
            png = await saved(page, "#save-png", tmp_path)
            assert {svg.name, png.name} == {
                f"{log.stem}-tick-{tick}.svg",
                f"{log.stem}-tick-{tick}.png",
            }
            here, there = await painted(svg, scheme), image.imread(png)[..., :3]
            size = [min(pair) for pair in zip(here.shape, there.shape, strict=True)]
            assert np.abs(np.subtract(here.shape, there.shape)).max() <= 1
            off = np.abs(here[: size[0], : size[1]] - there[: size[0], : size[1]])
            # Letters are set by another hand in an SVG, half a dot off.
            assert off.mean() < 0.01, off.mean()
            assert there.std() > 0.02  # there is something on it


async def test_the_svg_names_every_sensor_and_is_the_same_again(
    unread_log: Path, tmp_path: Path
) -> None:
    names = RunView(unread_log).options.sensors
    async with opened(unread_log, f"#t={READ}") as page:
        await wait_shown(page, READ)
        first = (await saved(page, "#save-svg", tmp_path)).read_bytes()
        assert (await saved(page, "#save-svg", tmp_path)).read_bytes() == first
    root = ElementTree.fromstring(first)
    title = root.find(f"{SVG}title")
    assert title is not None
    assert title.text == f"Learned order of {unread_log.name}, tick {READ}"
    texts = [text.text for text in root.iter(f"{SVG}text")]
    assert set(names) <= set(texts)
    assert "?" in texts  # of what is unknown
    tiles = {f"url(#{tile.get('id')})" for tile in root.iter(f"{SVG}pattern")}
    hatched = [path for path in root.iter(f"{SVG}path") if path.get("fill") in tiles]
    assert len(hatched) == 1  # what is predicted
    assert all("NaN" not in str(mark.attrib) for mark in root.iter())


async def test_each_tab_gives_its_table(unread_log: Path, tmp_path: Path) -> None:
    view = RunView(unread_log)
    names = view.options.sensors
    session = ViewSession(unread_log)
    while session.time_series.read_on() or session.raster.read_on():
        pass

    async def table(tab: str) -> list[list[str]]:
        await page.click(f"#tab-{tab}")
        path = await saved(page, "#save-csv", tmp_path)
        assert path.name == f"unread-tick-{READ}-{tab}.csv"
        return list(csv.reader(path.read_text(encoding="utf-8").splitlines()))

    async with opened(unread_log, f"#t={READ}") as page:
        await wait_shown(page, READ)
        await page.wait_for_selector('#plots[aria-busy="false"]')
        edges = session.time_series.series("edges", 1, view.last, 600)
        heads, *rows = await table("plots")
        place = heads.index("edges")
        assert [int(row[0]) for row in rows] == list(range(1, view.last + 1))
        assert [float(row[place]) for row in rows] == edges.values
        await page.click("#tab-raster")
        await page.wait_for_selector("#raster canvas[aria-label*=over]")
        heads, *rows = await table("raster")
        assert heads == ["tick", *names]
        part = session.raster.part(1, view.last, 600, 0, 9)
        told = np.frombuffer(part.values, np.uint8).reshape(view.last, -1)
        words = {ON: "on", OFF: "off"}
        for row, values in zip(rows, told.tolist(), strict=True):
            for word, value in zip(row[1:], values, strict=True):
                assert word == words.get(value, word)
        assert rows[READ - 1][1:] == ["on", "on, predicted", "unknown"]
        heads, *rows = await table("sensors")
        assert heads[:4] == ["Sensor", "Reads", "State", "Belief"]
        assert [row[0] for row in rows] == list(names)
        assert [row[2] for row in rows] == ["on", "on", "unknown"]
        await page.wait_for_selector("#tab-compare")
        await page.click("#tab-compare")
        await page.wait_for_selector(".differences table")
        heads, *rows = await table("compare")
        assert heads == ["what", "of", f"tick {READ}", f"tick {READ - 1}"]
        assert ["reads", "s1", "unknown", "on"] in rows
        await page.click("#tab-cells")
        await page.wait_for_selector("#cells tbody tr")
        heads, *rows = await table("cells")
        assert heads[0] == "Part"
        assert "coordinator" in [row[0] for row in rows]


async def test_the_table_is_written_as_export_writes_it(path_log: Path) -> None:
    fields = st.text(st.sampled_from("ab,\"'\n\r\t=+-@＝é "), max_size=6)
    found: list[list[list[str]]] = []

    @given(st.lists(st.lists(fields, min_size=2, max_size=2), min_size=1, max_size=3))
    def collect(rows: list[list[str]]) -> None:
        found.append(rows)

    collect()
    async with opened(path_log, "#t=1") as page:
        written = await page.evaluate(
            """async (all) => {
                const { asCsv } = await import("/base/csv.js");
                return all.map(asCsv);
            }""",
            found,
        )
    for rows, text in zip(found, written, strict=True):
        told = list(csv.reader(io.StringIO(text, newline="")))
        assert told == [[as_text(field) for field in row] for row in rows]


@pytest.mark.parametrize(
    "answer", ["new Promise(() => {})", "Promise.reject(new Error('gone'))"]
)
async def test_a_table_is_not_saved_before_all_of_it_was_read(
    path_log: Path, answer: str
) -> None:
    async with opened(path_log) as page:
        await page.wait_for_selector('#plots[aria-busy="false"]')
        given: list[object] = []
        page.on("download", lambda download: given.append(download))
        await page.evaluate(
            f"""async () => {{
                const {{ page }} = await import("/main.js");
                page.plots._on.fetchSeries = () => {answer};
                page.plots.load(1, 5).catch(() => {{}});
            }}"""
        )
        await page.click("#save-csv")
        await expect(page.locator("#said")).to_contain_text("still being read")
        assert given == []
