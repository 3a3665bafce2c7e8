"""An environment's own images on the page, in a real browser."""

import asyncio
import io
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.async_api import Page, expect

from neurosnap import wire
from neurosnap.recording.read.file import Recorded
from neurosnap.recording.read.recording import Recording
from tests.support.browser_pages import IN_BROWSER, go_to, opened
from tests.support.page_faults import faults
from tests.support.recorded_runs import recorded
from tests.support.rewritten_recordings import rewritten
from tests.support.run_options import options_for
from tools.browser import Scheme, wait_until

pytestmark = IN_BROWSER

LAKE = "neurosnap/FrozenLake-v0"
TICKS = 20
EVERY = 6


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = options_for(LAKE, 5, ticks=TICKS, cells="inline", frames=EVERY)
    return recorded(options, tmp_path_factory.mktemp("lake") / "run.mcap")


def images(log: Path) -> dict[int, bytes]:
    return {
        each.message.tick: each.message.data
        for each in Recording.open(log).messages(("image",))
        if isinstance(each.message, wire.Image)
    }


async def painted(page: Page) -> list[int]:
    """Return the colours of the image that is shown, as the browser decoded it."""
    await wait_until(page, "document.querySelector('#image-drawing').complete")
    found: list[int] = await page.evaluate(
        """() => {
            const image = document.querySelector("#image-drawing");
            const { naturalWidth: width, naturalHeight: height } = image;
            const canvas = new OffscreenCanvas(width, height);
            const context = canvas.getContext("2d");
            context.drawImage(image, 0, 0);
            return [...context.getImageData(0, 0, width, height).data];
        }"""
    )
    return found


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_the_latest_image_is_shown_with_its_tick(
    scheme: Scheme, log: Path
) -> None:
    recorded_images = images(log)
    assert sorted(recorded_images) == [1, 7, 13, 19]
    async with opened(log, scheme=scheme) as page:
        shown = page.locator("#image-drawing")
        # Back and forth: what is shown follows from the tick alone.
        for tick in (1, 6, 7, 20, 12, 13, 2):
            await go_to(page, tick)
            of = tick - (tick - 1) % EVERY
            await expect(page.locator("#image-tick")).to_have_text(f"tick {of}")
            said = f"The environment at tick {of}, as it draws itself."
            await expect(shown).to_have_attribute("alt", said)
            await expect(shown).to_be_visible()
            pixels = np.array(await painted(page), np.uint8).reshape(-1, 4)[:, :3]
            image = Image.open(io.BytesIO(recorded_images[of])).convert("RGB")
            np.testing.assert_array_equal(pixels, np.asarray(image).reshape(-1, 3))
        assert await faults(page) == []


async def test_where_one_is_lost_the_one_before_is_shown(
    log: Path, tmp_path: Path
) -> None:
    def without(gone: set[int], name: str) -> Path:
        def kept(recorded: Iterable[Recorded]) -> list[Recorded]:
            return [
                each
                for each in recorded
                if not isinstance(each.message, wire.Image)
                or each.message.tick not in gone
            ]

        return rewritten(log, tmp_path / name, kept)

    lossy = await asyncio.to_thread(without, {13}, "lossy.mcap")
    async with opened(lossy) as page:
        for tick, of in ((12, 7), (13, 7), (18, 7), (19, 19)):
            await go_to(page, tick)
            await expect(page.locator("#image-tick")).to_have_text(f"tick {of}")
    bare = await asyncio.to_thread(without, {1, 7, 13, 19}, "bare.mcap")
    async with opened(bare) as page:
        await go_to(page, 9)
        said = "none near this tick was recorded"
        await expect(page.locator("#image-tick")).to_have_text(said)
        await expect(page.locator("#image-drawing")).to_be_hidden()
        assert await faults(page) == []


async def test_an_image_that_cannot_be_had_is_said_to(log: Path) -> None:
    async with opened(log, but_for="status of 500") as page:
        await page.route("**/api/image?tick=7", lambda route: route.fulfill(status=500))
        await go_to(page, 8)
        said = "the image of tick 7 cannot be had"
        await expect(page.locator("#image-tick")).to_have_text(said)
        await expect(page.locator("#image-drawing")).to_be_hidden()
        await go_to(page, 14)
        await expect(page.locator("#image-drawing")).to_be_visible()


async def test_a_run_without_images_has_no_such_panel(path_log: Path) -> None:
    async with opened(path_log) as page:
        await expect(page.locator("#image")).to_be_hidden()
        answer = await page.request.get(f"{page.url.split('?')[0]}api/image?tick=1")
        assert answer.status == 404


async def test_the_server_sends_an_image_as_what_it_is(log: Path) -> None:
    async with opened(log) as page:
        home = page.url.split("?")[0].split("#")[0]
        answer = await page.request.get(f"{home}api/image?tick=7")
        assert answer.headers["content-type"] == "image/png"
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert await answer.body() == images(log)[7]
        for tick, status in ((8, 404), (99, 404), ("x", 400)):
            answer = await page.request.get(f"{home}api/image?tick={tick}")
            assert answer.status == status
            assert "error" in await answer.json()
