"""A limit on readings that wait that tests can reach in little time."""

import pytest

from neurosnap.sources.live import live_source
from neurosnap.sources.live.live_source import ROOM


@pytest.fixture(autouse=True)
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source, "WAITING", ROOM)
