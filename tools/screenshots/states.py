"""The states of the page to take pictures of, and how to reach each."""

from collections.abc import Awaitable, Callable
from typing import NamedTuple, TypeAlias

from playwright.async_api import Page

from tools.browser import SIZE, wait_shown, wait_until

Step: TypeAlias = Callable[[Page], Awaitable[object]]

PHONE = 390, 844
"""Pixels of a telephone."""
_SOUGHT = "room1 is:contradicted"


class State(NamedTuple):
    """A state of the page."""

    recordings: tuple[str, ...]
    """By their names in `RECORDINGS`; the first is looked at."""
    tick: int
    link: str = ""
    """What else the address says."""
    steps: tuple[Step, ...] = ()
    """What is done then."""
    size: tuple[int, int] = SIZE
    """Of the page, in pixels."""


def _press(key: str) -> Step:
    return lambda page: page.press("body", key)


def _seen(what: str) -> Step:
    return lambda page: page.wait_for_selector(what)


def _true(condition: str) -> Step:
    return lambda page: wait_until(page, condition)


async def _half_way(page: Page) -> None:
    """Let the wave go half of its way, with pulses under way."""
    hops = int(await page.get_attribute("#wave-hop", "max") or "0")
    await page.fill("#wave-hop", str(hops // 2 + 0.5))


async def _over_curves(page: Page) -> None:
    """Have the pointer over a curve."""
    await page.locator("#plots .u-over").nth(2).hover()


_READ = (
    _true("!document.querySelector('#plots[aria-busy=true]')"),
    _true("!/so far|^What happened$/.test(document.querySelector('#strip').ariaLabel)"),
    _true("!/…/.test(document.querySelector('#tab-findings').textContent)"),
    _seen("#focus-only button:nth-of-type(5):visible"),
)
"""All of the recording has been read."""

STATES: dict[str, State] = {
    "diagram": State(("path",), 214),
    "wave": State(
        ("path",), 214, "wave=forward", (_half_way, _seen("#drawing-wave:visible"))
    ),
    "time": State(
        ("path",),
        100,
        "range=30-160&tab=plots",
        (
            _press("t"),
            _true("document.querySelector('#plots .uplot').clientHeight > 99"),
            _over_curves,
        ),
    ),
    "belief": State(("packing",), 383, "sensor=moving"),
    "raster": State(
        ("packing",),
        383,
        "tab=raster",
        (_press("t"), _seen("#raster canvas[aria-label*='1 to 400']")),
    ),
    "large": State(
        ("crowd",), 150, "", (lambda page: page.fill("#search-text", _SOUGHT),)
    ),
    "focus": State(("crowd",), 150, "sensor=room07_below_12"),
    "compare": State(
        ("path", "path-lax"),
        110,
        "tab=compare",
        (_press("t"), _seen("#compare .differences table")),
    ),
    "plan": State(
        ("lake",),
        503,
        "tab=grown",
        (_seen("#grown-list tbody tr"), _seen("#image-drawing:visible")),
        (1280, 900),
    ),
    "chance": State(
        ("slippery",), 737, "", (_seen("#image-drawing:visible"),), (1280, 900)
    ),
    "phone": State(("packing",), 383, "", (), PHONE),
}
"""By name."""


MOVING = State(("path",), 214, "wave=forward", (), (1130, 860))
"""The wave that moves."""


async def enter(page: Page, state: State, address: str) -> None:
    """Bring an empty page into a state.

    Args:
        page: It shows nothing yet.
        state: Which.
        address: Of a server of its recordings.
    """
    width, height = state.size
    await page.set_viewport_size({"width": width, "height": height})
    await page.goto(f"{address}#t={state.tick}&{state.link}")
    await wait_shown(page, state.tick)
    for step in (*_READ, *state.steps):
        await step(page)
