"""The cells and workers of a swarm without a network."""

from collections.abc import Sequence
from typing import TypeAlias

from neurosnap import wire
from neurosnap.protocol import worker_shares
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.worker import Worker
from neurosnap.sensorium import pack

Host: TypeAlias = Cell | Worker
Row: TypeAlias = Sequence[bool | None]
"""What every sensor reads at a tick, None if it is unknown."""


def hosting(sensors: int, workers: int) -> dict[str, Host]:
    """Return the parts that cells are, or are hosted by, by name."""
    if not workers:
        return {f"cell/{number}": Cell(number) for number in range(sensors)}
    hosted = worker_shares.shares(sensors, workers)
    return {f"worker/{number}": Worker(number, hosted) for number in range(workers)}


def keys_of(host: Host) -> tuple[str, ...]:
    """Return the keys that a host listens to."""
    if isinstance(host, Cell):
        return wire.cell_keys(host.cell)
    return wire.worker_keys(host.worker, learns=False)


def observation(tick: int, row: Row) -> wire.Observation:
    """Return a row of readings as the world would tell it."""
    bits, known = pack([on is True for on in row]), pack([on is not None for on in row])
    return wire.Observation(tick, bits, known=known if None in row else b"")
