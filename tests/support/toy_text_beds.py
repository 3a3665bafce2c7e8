"""The worlds of Gymnasium's toy text, and the moves in their tables."""

from collections.abc import Callable
from typing import Any

from neurosnap.agent.binary_sensors import BinarySensors
from tests.support.transition_tables import Table
from world.toy_text import cliff_walking, frozen_lake, taxi

BEDS: list[Callable[..., BinarySensors]] = [frozen_lake, cliff_walking, taxi]
VARIANTS: list[tuple[Callable[..., BinarySensors], dict[str, Any]]] = [
    (frozen_lake, {}),
    (frozen_lake, {"map_name": "8x8"}),
    (frozen_lake, {"is_slippery": True}),
    (cliff_walking, {}),
    (cliff_walking, {"is_slippery": True}),
    (taxi, {}),
    (taxi, {"is_rainy": True}),
]

Situation = tuple[int, bool]  # a state, and whether the episode is over there
Move = tuple[Situation, int, Situation]


def situations(table: Table) -> list[Situation]:
    return list(zip(table.states.tolist(), table.over.tolist(), strict=True))


def moves(table: Table) -> set[Move]:
    at = situations(table)
    rows = zip(
        table.before.tolist(), table.action.tolist(), table.after.tolist(), strict=True
    )
    return {(at[before], action, at[after]) for before, action, after in rows}
