"""Sensors grown and retired in places the agent has visited."""

from itertools import product

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.memory import AgentMemory
from neurosnap.sources.open import open_source
from tests.golden.drive import drive
from tests.support.lamp import LIMITED, lamp_options


def test_nothing_is_known_of_a_newborn_with_one_that_retired() -> None:
    """The history still has what that one read."""
    options = lamp_options(
        ticks=188, cells="inline", imagine=0, explore=1.0, threshold=0.05
    )
    options = msgspec.structs.replace(options, target=("lit",))
    source = open_source(options.source, options.seed, options.arguments)
    driven = drive(options, source)
    changes = [m for m in driven.published if isinstance(m, wire.Decision)]
    born = [m.born for m in changes if m.born >= 0]
    retired = [m.retires for m in changes if m.retires >= 0]
    assert (len(born), retired) == (2, born[:1])
    snapshot, names = driven.core.snapshot, range(2)
    weights = [
        snapshot.weight(2 * born[1] + a, 2 * born[0] + b)
        for a, b in product(names, names)
    ]
    assert weights == [0, 0, 0, 0]
    others = [snapshot.weight(2 * born[1], 2 * k) for k in range(born[0])]
    assert any(others)


def test_an_action_led_nowhere_where_the_world_was_cut_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What follows a limit on time is not what the last action did."""
    taken: list[int] = []
    observe = AgentMemory.observe

    def spy(memory: AgentMemory, action: int, *rest: object) -> object:
        taken.append(action)
        return observe(memory, action, *rest)  # type: ignore[arg-type]

    options = lamp_options(LIMITED, ticks=20)
    source = open_source(options.source, options.seed, options.arguments)
    monkeypatch.setattr(AgentMemory, "observe", spy)
    driven = drive(options, source)
    observed = [m for m in driven.published if isinstance(m, wire.Observation)]
    decided = {
        m.tick: m.action for m in driven.published if isinstance(m, wire.Decision)
    }
    assert [m.tick for m in observed if m.cut] == [10, 19]
    assert taken == [-1 if m.cut else decided[m.tick - 1] for m in observed]
