"""The states of the page that the documentation shows."""

import re
from pathlib import Path

import pytest

from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from tests.support.browser_pages import IN_BROWSER, looked_at
from tests.support.page_faults import faults
from tools.browser import Scheme
from tools.screenshots.recordings import recorded
from tools.screenshots.states import STATES, enter

pytestmark = IN_BROWSER

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recordings")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", STATES)
async def test_each_state_can_be_entered_and_axe_finds_nothing_in_it(
    name: str, scheme: Scheme, recordings: Path
) -> None:
    state = STATES[name]
    logs = [recorded(each, recordings) for each in state.recordings]
    async with (
        serving(*map(ViewSession, logs)) as address,
        looked_at(address.url, scheme, still=True) as page,
    ):
        await enter(page, state, address.url)
        assert await faults(page) == []
        # No picture tells of this machine.
        assert str(recordings) not in await page.inner_text("body")


async def test_the_documentation_shows_each_of_them() -> None:
    texts = [page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md")]
    shown = {name for text in texts for name in re.findall(r"view-(\w+)\.png", text)}
    assert shown == set(STATES)
    for name in STATES:
        assert (DOCS / f"view-{name}.png").is_file()
