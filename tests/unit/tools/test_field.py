"""The latency of a reading ends with the state of the first tick that has it."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.sources.protocol import Observed
from tests.support.inline_runs import (
    ACTIONS,
    implying_rows,
    record_scripted,
    scripted_options,
)
from tests.support.scripted_sources import Scripted
from tools.bench.field import latencies


class Counted(Scripted):
    """One that received some readings by each tick."""

    def _show(self, *, begins: bool = False, cut: bool = False) -> Observed | None:
        seen = super()._show(begins=begins, cut=cut)
        assert seen is not None
        received = wire.Received(shown=(1, 1, 3, 6)[self._next - 1], late=1)
        return msgspec.structs.replace(seen, received=received)


@pytest.mark.slow
def test_a_reading_is_in_the_first_tick_that_counts_it(tmp_path: Path) -> None:
    source = Counted(implying_rows(4, 1), ACTIONS)
    log = record_scripted(source, scripted_options(4), tmp_path / "log")
    logged = [each.log_time / 1e9 for each in Recording.open(log).messages(("state",))]
    stamps = np.array([0.0, *logged[3] + np.arange(7)])
    ends = np.array(logged)[[0, 2, 2, 3, 3, 3]]  # of all but the first and the last
    assert latencies(stamps, log).tolist() == pytest.approx(list(ends - stamps[1:7]))
    early = np.zeros(2)
    assert latencies(early, log).tolist() == pytest.approx([logged[0]] * 2)
