"""The random draws of an agent: functions of its seed and the tick alone."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError

WIDTH = 4
"""Numbers a tick: what one turn of the Philox counter gives."""
_BLOCK = 1024  # ticks drawn at once: making a generator costs as much as a tick


class RandomNumbers:
    """Numbers in [0, 1), `WIDTH` for every tick, from a counter-based generator.

    Numbers that came from one stream would depend on how many were drawn before, and so
    on the order in which messages arrived. These depend on the seed, the generator's
    key from 0 up, and the tick alone.

    Raises:
        InvalidValueError: The seed is out of range.

    Examples:
        >>> RandomNumbers(seed=7).at(3).shape
        (4,)
    """

    def __init__(self, seed: int) -> None:
        if not 0 <= seed < 2**128:
            raise InvalidValueError("seed", "must be in [0, 2**128)", seed)
        self._seed = seed
        self._number = -1
        self._block: NDArray[np.float64] = np.empty((0, WIDTH))

    def at(self, tick: int) -> NDArray[np.float64]:
        """Return the numbers of `tick`, from 0 up: ``(WIDTH,)``, read-only."""
        number, place = divmod(tick, _BLOCK)
        if number != self._number:
            generator = np.random.Philox(key=self._seed)
            generator.advance(number * _BLOCK)
            raw = generator.random_raw(WIDTH * _BLOCK)
            # The upper 53 bits, as numpy makes its doubles.
            numbers = (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53
            self._block = numbers.reshape(_BLOCK, WIDTH)
            self._block.flags.writeable = False
            self._number = number
        drawn: NDArray[np.float64] = self._block[place]
        return drawn


def pick(options: NDArray[np.int64], draw: float) -> int:
    """Return one of `options`, each as likely, by a number in [0, 1)."""
    return int(options[int(draw * len(options))])
