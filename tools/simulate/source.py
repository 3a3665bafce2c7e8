"""The source of a simulated run; some runs have unknown readings."""

import random

import numpy as np

from neurosnap.protocol.run_options import RunOptions
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Observed, Source

_SHARES = (0.0, 0.0, 0.1, 0.4)  # of the readings that are unknown


def source_of(options: RunOptions) -> Source:
    """Open the source of a run; its seed says how much of it is unknown."""
    source = open_source(options.source, options.seed, options.arguments)
    share = _SHARES[options.seed % len(_SHARES)]
    return Partial(source, share, options.seed) if share else source


class Partial:
    """Hides some readings of a source, the same ones whenever it starts over.

    Args:
        source: Where they come from.
        share: How many of them are hidden; in each observation one is left.
        seed: Draws which.
    """

    def __init__(self, source: Source, share: float, seed: int) -> None:
        self._source = source
        self._share = share
        self._seed = seed
        self._chance = random.Random(seed)
        self.sensors = source.sensors
        self.orders = source.orders
        self.actions = source.actions
        self.discrete = source.discrete
        self.length = source.length
        self.live = source.live

    def first(self) -> Observed | None:
        """Start over."""
        self._chance = random.Random(self._seed)
        return self._partly(self._source.first())

    def step(self, action: int) -> Observed | None:
        """Go on."""
        return self._partly(self._source.step(action))

    def close(self) -> None:
        """Close the source."""
        self._source.close()

    def _partly(self, seen: Observed | None) -> Observed | None:
        if seen is None:
            return None
        draws = [self._chance.random() >= self._share for _ in seen.bits]
        draws[self._chance.randrange(len(draws))] = True
        known = np.array(draws)
        bits = np.where(known, seen.bits, True)  # what is unknown means nothing
        hidden = None if known.all() else known
        return Observed(bits, hidden, seen.begins, seen.cut)
