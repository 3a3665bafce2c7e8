"""The partition of cells over workers, and the names of the parts."""

import math
from itertools import pairwise

from neurosnap.errors import InvalidValueError


def shares(cells: int, workers: int) -> list[range]:
    """Divide `cells` among `workers`: runs of neighbours, as even as they can be.

    Returns:
        The cells of each worker, ascending; sizes differ by at most one, larger first.

    Raises:
        InvalidValueError: There are too few or too many workers.

    Examples:
        >>> shares(5, 2)
        [range(0, 3), range(3, 5)]
    """
    if not 1 <= workers <= cells:
        rule = f"must be at least 1 and at most the cells, {cells}"
        raise InvalidValueError("workers", rule, workers)
    size, longer = divmod(cells, workers)
    starts = [size * worker + min(worker, longer) for worker in range(workers + 1)]
    return [range(*pair) for pair in pairwise(starts)]


def learning_shares(sensors: int, workers: int) -> list[range]:
    """Divide the pairs of sensors among `workers`, as evenly as whole rows can be.

    A row is the pairs of a sensor with those before it, so the first worker has the
    most rows.

    Returns:
        The sensors of each worker, ascending; some may have none.

    Examples:
        >>> learning_shares(10, 2)
        [range(0, 7), range(7, 10)]
    """
    ends = [round(sensors * math.sqrt(k / workers)) for k in range(workers + 1)]
    return [range(*pair) for pair in pairwise(ends)]


def hosts(cells: int, workers: int) -> list[str]:
    """Return the names of the parts that cells are, or are hosted by, in order.

    Without workers every cell is a part by itself.

    Examples:
        >>> hosts(3, 0), hosts(3, 2)
        (['cell/0', 'cell/1', 'cell/2'], ['worker/0', 'worker/1'])
    """
    role, count = ("worker", workers) if workers else ("cell", cells)
    return [f"{role}/{number}" for number in range(count)]
