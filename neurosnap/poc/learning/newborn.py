"""What a snapshot takes in with a sensor that is grown."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Newborn(NamedTuple):
    """What is known of a sensor that is grown, of its pairs with those before it."""

    ticks: int
    """How long the history is."""
    squares: NDArray[Any]
    """``(4, sensor)``: the weights ``w_ij, w_ij*, w_i*j, w_i*j*``, itself first."""
    codes: NDArray[np.uint8]
    """``(sensor,)``: what follows from them; see `neurosnap.poc.learning.pair_codes`.
    """
