"""How a budget of alarms is shared: numbers worked out by hand."""

import pytest

from neurosnap.health.budget import shares


@pytest.mark.parametrize(
    ("raised", "part"),
    [(0, 1.0), (3, 1.0), (4, 1.0), (8, 0.5), (40, 0.1)],  # four in four weeks are due
)
def test_one_alarm_a_week_is_shared_by_four_sensors(raised: int, part: float) -> None:
    by_hand = [0.125, 0.025, 0.05, 0.025, 0.025]
    assert shares(1.0, 4, raised) == pytest.approx([part * share for share in by_hand])
