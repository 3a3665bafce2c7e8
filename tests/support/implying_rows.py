"""Readings of three sensors, of which the first implies the second."""

import random


def implying_rows(
    ticks: int, seed: int, unknown: float = 0.0
) -> list[list[bool | None]]:
    """Draw rows; the third sensor is on at random, and always known.

    Args:
        ticks: How many.
        seed: Draws them.
        unknown: How likely each reading of the first two is unknown.
    """
    chance = random.Random(seed)
    table: list[list[bool | None]] = []
    for _ in range(ticks):
        a, b, c = (chance.random() < 0.5 for _ in range(3))
        row: list[bool | None] = [a, a or b]
        if unknown:
            row = [None if chance.random() < unknown else on for on in row]
        table.append([*row, c])
    return table
