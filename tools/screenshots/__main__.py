#!/usr/bin/env python3
"""Takes the pictures of the `neurosnap view` page for docs/; one is animated.

    tools/screenshots [--only diagram wave moving] [--out DIR] [--dark]

In dark colours they are WebP files of few colours, `view-wave-dark.webp` for one: they
stand beside the others, for readers whose system is dark.

The recordings are made first, in half a minute.
"""

import argparse
import asyncio
import io
import sys
import tempfile
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from PIL import Image
from playwright.async_api import Page

from neurosnap.apps.viewer.opened_recording import ViewSession
from neurosnap.apps.viewer.server import serving
from tools.browser import Scheme, new_page, started
from tools.screenshots.recordings import recorded
from tools.screenshots.states import MOVING, STATES, enter

_EACH = {**STATES, "moving": MOVING}
_PACE = 150, 1500
"""Milliseconds that a picture of the moving wave stands, and the last one."""
_COLOURS = 48
_DARK_COLOURS = 256


def _write_few_colours(picture: bytes, path: Path) -> None:
    """Write a picture with no more colours than it takes, which is a third as large."""
    few = (
        Image.open(io.BytesIO(picture))
        .convert("RGB")
        .quantize(_DARK_COLOURS, dither=Image.Dither.NONE)
    )
    few.convert("RGB").save(path, lossless=True, quality=100, method=6)


async def _moving(page: Page, path: Path) -> None:
    """Write the wave of a page as a moving picture of its diagram, hop by hop."""
    hops = int(await page.get_attribute("#wave-hop", "max") or "0")
    frames = []
    for quarter in range(4 * hops + 1):
        await page.evaluate(
            """(at) => {
                const slider = document.getElementById("wave-hop");
                [slider.step, slider.value] = [0.25, at];
                slider.dispatchEvent(new Event("input"));
            }""",
            quarter / 4,
        )
        shot = await page.locator("#drawing").screenshot(animations="disabled")
        frames.append(Image.open(io.BytesIO(shot)).convert("RGB"))
    # The same colours in all, of which the last picture has the most.
    palette = frames[-1].quantize(_COLOURS)
    few = [
        frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames
    ]
    stands = [_PACE[0]] * (len(few) - 1) + [_PACE[1]]
    few[0].save(path, save_all=True, append_images=few[1:], duration=stands, loop=0)


async def _main() -> None:
    parser = argparse.ArgumentParser(prog="screenshots", description="Take pictures.")
    parser.add_argument(
        "--only", nargs="+", choices=_EACH, default=list(_EACH), help="which of them"
    )
    parser.add_argument("--out", type=Path, default=Path("docs"), help="where they go")
    parser.add_argument("--dark", action="store_true", help="in dark colours")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    scheme: Scheme = "dark" if given.dark else "light"
    with tempfile.TemporaryDirectory() as folder:
        async with started() as browser:
            for name in given.only:
                state = _EACH[name]
                logs = [recorded(each, Path(folder)) for each in state.recordings]
                async with (
                    serving(*map(ViewSession, logs)) as address,
                    new_page(browser, scheme, still=True) as page,
                ):
                    await enter(page, state, address.url)
                    if state is MOVING:
                        path = given.out / (
                            "wave-dark.gif" if given.dark else "wave.gif"
                        )
                        await _moving(page, path)
                    elif given.dark:
                        path = given.out / f"view-{name}-dark.webp"
                        _write_few_colours(await page.screenshot(), path)
                    else:
                        path = given.out / f"view-{name}.png"
                        await page.screenshot(path=path)
                    print(path)


if __name__ == "__main__":
    asyncio.run(_main())
