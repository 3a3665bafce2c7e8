"""What axe finds wrong with the page as it is now."""

from pathlib import Path

from playwright.async_api import Page

_AXE = Path(__file__).parents[1] / "vendor" / "axe-core" / "axe.min.js"


async def faults(page: Page) -> list[object]:
    """Return the serious and critical ones, with the elements they are found in."""
    if not await page.evaluate("() => 'axe' in window"):
        await page.evaluate(_AXE.read_text(encoding="utf-8"))
    found: list[object] = await page.evaluate(
        """async () => (await axe.run()).violations
            .filter(({ impact }) => impact === "serious" || impact === "critical")
            .map(({ id, nodes }) => [id, nodes.map(({ html }) => html)])"""
    )
    return found
