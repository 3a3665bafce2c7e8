"""A limit on waiting readings that is low enough for tests to reach quickly."""

import pytest

from neurosnap.sources.live import live_source
from neurosnap.sources.live.live_source import ROOM


@pytest.fixture(autouse=True)
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source, "WAITING", ROOM)
