#!/usr/bin/env python3
"""Take the pictures of the page of `neurosnap view` that docs/ shows.

    tools/screenshots [--only diagram wave] [--out DIR] [--dark]

The recordings are made first, in half a minute.
"""

import argparse
import asyncio
import sys
import tempfile
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from neurosnap.apps.viewer.opened_recording import ViewSession
from neurosnap.apps.viewer.server import serving
from tools.browser import Scheme, new_page, started
from tools.screenshots.recordings import recorded
from tools.screenshots.states import STATES, enter


async def _main() -> None:
    parser = argparse.ArgumentParser(prog="screenshots", description="Take pictures.")
    parser.add_argument(
        "--only", nargs="+", choices=STATES, default=list(STATES), help="which of them"
    )
    parser.add_argument("--out", type=Path, default=Path("docs"), help="where they go")
    parser.add_argument("--dark", action="store_true", help="in dark colours")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    scheme: Scheme = "dark" if given.dark else "light"
    with tempfile.TemporaryDirectory() as folder:
        async with started() as browser:
            for name in given.only:
                state = STATES[name]
                logs = [recorded(each, Path(folder)) for each in state.recordings]
                async with (
                    serving(*map(ViewSession, logs)) as address,
                    new_page(browser, scheme, still=True) as page,
                ):
                    await enter(page, state, address.url)
                    path = given.out / f"view-{name}.png"
                    await page.screenshot(path=path)
                    print(path)


if __name__ == "__main__":
    asyncio.run(_main())
