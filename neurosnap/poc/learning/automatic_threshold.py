"""The automatic threshold: how many exceptions an implication may have.

An implication ``a -> b`` needs the least of its square, ``w_ab* < min(w_ab, w_a*b,
w_a*b*)``, as with any threshold. One that was never broken asks for no more. One that
was broken ``k = w_ab*`` times in ``t`` ticks stands while both of these hold:

1. *Exceptions are rare*: ``k < SHARE t - START``. It is the line of Wald's sequential
   test (1945). Say that an exception has, whatever came before, at least the chance
   ``p > SHARE``, and let ``x > 0`` solve ``p (1 - exp(-x)) = x SHARE``. Then
   ``exp(x (SHARE t - k))`` is a supermartingale, and by Ville's inequality (1939) `k`
   is *ever* below the line with a chance of at most ``exp(-START x)``: 1e-4 for ``p =
   1.1 SHARE``, 1e-33 for ``p = 2 SHARE``. One test may so be made at every tick.
2. *It is not chance that they are*: ``k < m`` and ``(m - k)² > DOUBT h (m + k)``, with
   ``m = n_a n_b* / 2t``, half of what they would be if `a` and `b` had nothing to do
   with each other. Loevinger's H (1948) is then above 1/2. ``h = 1 / (1 - s_a s_b*)``
   is how many ticks in a row an exception would last by chance, where ``s`` is the
   share of a literal's ticks after which it stays: of ``m + k`` ticks so many are one
   occasion. `DOUBT` is the square of the standard deviations that are asked for; it
   takes Poisson counts to be as wide as they are.

The first is asked at every tick. The second takes longer: it is asked of all pairs of a
sensor with those before it at every `TURNS`-th of that sensor's readings, and what was
broken stands in between if it stood before. Sensors that were always known are asked
at the same tick, so that twins come to the same.

Why what is derived is an order, whatever is observed ([GK] poc sets from
snapshots). *Acyclic*: with all readings known ``w_ab* < w_a*b`` says ``n_a < n_b``, so
along implications the marginals rise, and no threshold is needed for it; literals that
are equivalent have one marginal, so this stays true of their classes. *Closed under
contraposition*: ``b* -> a*`` has the same square, the same ``k``, ``t``, ``m`` and
``h``; a pair has one code for both. *One implication a square*: two of them would each
need the lesser weight. *Coherent*: of any graph closed under contraposition no ``a``,
``b`` in ``up(A) minus up(A)*`` have ``a <= b*`` ([GK] coherent projection). With
unknown readings that holds which holds of every threshold; see
`neurosnap.poc.learning.snapshot.Snapshot`.
"""

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.graph_kernels import Row
from neurosnap.poc.learning.twins import Parted, Twins, literals_of
from neurosnap.system.compiled import njit

AUTO: Final = "auto"
"""Given instead of a threshold: each pair chooses its own."""
SHARE: Final = 1 / 32
"""Of all ticks: how many exceptions there may be in the long run. Sensors of which each
flips one reading in fifty break an implication at up to two ticks in a hundred."""
START: Final = 48.0
"""How many fewer there may be: so none in the first 1,568 ticks. Few exceptions then
are what a rare truth of the opposite looks like, too."""
DOUBT: Final = 6.0
"""The square of how many standard deviations exceptions must be below half of those by
chance: 2.4, which a normal variable is once in 140 times."""
MARK: Final = np.uint8(16)
"""Added to the code of an implication that was broken before."""
TURNS: Final = 32
"""Readings of a sensor from one test of its pairs to the next."""
_NOTHING = 2
Spells: TypeAlias = tuple[NDArray[np.uint32], NDArray[np.uint8]]
"""What the second test takes besides the weights: ``(2, 2N)``, at how many ticks each
literal was read, and after how many of them its complement was read next; and ``(N,)``,
whether it is a sensor's turn to be tested at this tick."""


class Persistence:
    """How often each literal was read, and how often a spell of such readings ended.

    That a door is open with a lamp on for an hour is one occasion, and not as many as
    ticks were counted. Unknown readings in between are left out. A sensor that is grown
    has none before it is read, whatever its history.

    Attributes:
        spells: The counts.
    """

    def __init__(self, sensors: int) -> None:
        counts = np.zeros((2, 2 * sensors), np.uint32)
        self.spells: Spells = counts, np.zeros(sensors, np.uint8)
        self._last = np.full(sensors, _NOTHING, np.uint8)

    def count(self, bits: NDArray[np.uint8], known: NDArray[np.uint8]) -> None:
        """Count an observation; see `count_readings`. O(N) time."""
        count_readings(bits, known, self._last, self.spells)

    def copy(self, parted: Parted) -> None:
        """Let groups of twins that have parted have the counts that they had as one."""
        counts, turns = self.spells
        literals = literals_of(parted.source)
        counts = counts[:, literals]
        counts[:, literals < 0] = 0
        self.spells = counts, parted.of_groups(turns)
        self._last = parted.of_groups(self._last)

    def arrays(self, twins: Twins) -> Arrays:
        """Return its whole state as arrays, by name, of all twins."""
        spells = self.spells[0][:, twins.literals]
        return {"spells": spells, "last": self._last[twins.of]}

    def restore(self, arrays: Arrays, twins: Twins) -> None:
        """Restore the whole state from arrays; it is no sensor's turn.

        Raises:
            ValueError: They make no sense.
        """
        (counts, _), sensors = self.spells, len(twins.of)
        spells = entry(arrays, "spells", (2, 2 * sensors), np.uint32)
        last = entry(arrays, "last", (sensors,), np.uint8)
        counts[:], self._last[:] = spells[:, twins.names], last[twins.heads]
        if (counts[1] > counts[0]).any() or (self._last > _NOTHING).any():
            raise ValueError("spells, last: must be what readings make")


@njit()
def count_readings(
    bits: NDArray[np.uint8],
    known: NDArray[np.uint8],
    last: NDArray[np.uint8],
    spells: Spells,
) -> None:
    """Count how often each literal was read, and how often its complement followed.

    Args:
        bits: ``(N,)``, 0 or 1; any where unknown.
        known: ``(N,)``, 0 or 1.
        last: ``(N,)``, what each sensor last read; 2: nothing yet. Updated.
        spells: Updated.
    """
    counts, turns = spells
    read, ended = counts[0], counts[1]
    for s in range(bits.shape[0]):
        turns[s] = 0
        if known[s]:
            literal = 2 * s + 1 - np.int64(bits[s])
            read[literal] += np.uint32(1)
            if last[s] == 1 - bits[s]:
                ended[literal ^ 1] += np.uint32(1)
            last[s] = bits[s]
            turns[s] = (np.int64(read[2 * s]) + read[2 * s + 1]) % TURNS == 0


@njit()
def share_of_changes(spells: Spells, a: int, b: int) -> float:
    """Return ``1 / h``: after what share of their ticks two literals are not both read.

    If neither had to do with the other. It is 0 where one was never read: nothing is
    tolerated then.
    """
    counts, _ = spells
    read, ended = counts[0], counts[1]
    if not (read[a] and read[b]):
        return 0.0
    stays_a = 1.0 - float(ended[a]) / float(read[a])
    stays_b = 1.0 - float(ended[b]) / float(read[b])
    return 1.0 - stays_a * stays_b


@njit()
def is_tolerated(
    against: float, from_a: float, from_b: float, total: float, changes: float
) -> bool:
    """Return whether exceptions are surely less than half of those by chance.

    Args:
        against: ``k = w_ab*``.
        from_a: ``n_a = w_ab + w_ab*``.
        from_b: ``n_b* = w_a*b* + w_ab*``.
        total: ``t``.
        changes: ``1 / h``.
    """
    # Both sides times (2 t)² / h: nothing is divided, and products commute.
    chance, twice = from_a * from_b, 2.0 * total
    gap = chance - twice * against
    enough = DOUBT * twice * (chance + twice * against)
    return (gap > 0.0) & (gap * gap * changes > enough)


@njit()
def withstand(
    i: int,
    due: int,
    row: Row,
    spells: Spells,
    codes: NDArray[np.uint8],
    fresh: NDArray[np.uint8],
) -> None:
    """Take back the codes of one row that are broken too often, and all marks.

    Args:
        i: The row, a sensor.
        due: Whether it is its turn to be tested.
        row: The weights of its pairs; they matter when it is due.
        spells: As of `Persistence`.
        codes: ``(i,)``, as they were.
        fresh: ``(i,)`` or longer, as they were judged; updated.
    """
    for j in range(codes.shape[0]):
        code = np.uint8(fresh[j] & ~MARK)
        stands = (fresh[j] < MARK) | (code == codes[j])
        if due and fresh[j] >= MARK:
            stands = _passes(code, i, j, row, spells)
        fresh[j] = code if stands else np.uint8(0)


@njit()
def _passes(code: np.uint8, i: int, j: int, row: Row, spells: Spells) -> bool:
    """Return whether it is no chance that an implication is broken so seldom."""
    both, only_i = float(row.both[j]), float(row.only_i[j])
    only_j, neither = float(row.only_j[j]), float(row.neither[j])
    if code == 1:
        against, from_a, from_b, a, b = only_i, both, neither, 2 * i, 2 * j + 1
    elif code == 2:
        against, from_a, from_b, a, b = only_j, neither, both, 2 * i + 1, 2 * j
    elif code == 4:
        against, from_a, from_b, a, b = both, only_i, only_j, 2 * i, 2 * j
    else:
        against, from_a, from_b, a, b = neither, only_j, only_i, 2 * i + 1, 2 * j + 1
    total = both + only_i + only_j + neither
    changes = share_of_changes(spells, a, b)
    return is_tolerated(against, from_a + against, from_b + against, total, changes)
