"""Numbers of cells or workers, as those who start some of them give them."""

from collections.abc import Sequence
from typing import NamedTuple

from neurosnap.errors import InvalidValueError


class Numbers(NamedTuple):
    """Some numbers, ascending, and perhaps all from another one on."""

    some: Sequence[int]
    """Those that were given one by one, or as a range."""
    rest: int | None = None
    """From where on all are meant; None: no others are."""

    def of(self, name: str, count: int) -> list[int]:
        """Return the numbers where there are so many, ascending.

        Args:
            name: What they are of: cells, workers.
            count: How many there are.

        Raises:
            InvalidValueError: One is of none that there is, or `rest` is.

        Example:
            >>> Numbers((1,), 3).of("cells", 6)
            [1, 3, 4, 5]
        """
        if not count:
            rule = f"must go with a swarm that has {name}"
            raise InvalidValueError(name, rule, self.some or self.rest)
        last = [*self.some[-1:], *([] if self.rest is None else [self.rest])][-1]
        if last >= count:
            rule = f"must be {name} of the swarm, 0 to {count - 1}"
            raise InvalidValueError(name, rule, last)
        open_range = () if self.rest is None else range(self.rest, count)
        return [*self.some, *open_range]
