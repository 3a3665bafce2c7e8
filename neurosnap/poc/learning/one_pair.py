"""The discounted weights of one pair of sensors, in plain Python.

A cell works with them, and its process loads neither numpy nor numba: so here is, for
one pair, what `neurosnap.poc.learning.update_kernels_partial` compiles for many. Each
operation on floats is done in the same order there, so that the results are the same
bits.
"""

SLACK = 1e-12
"""By how much a discounted weight must be smaller to count as smaller."""
TINY = 1e-300
"""Halving goes on below the least normal number, where arithmetic is a hundred times
slower; what is as small as this is 0 to every comparison already."""
LENGTH = 8192
"""Ticks that a history keeps unless told otherwise: 2 kB a sensor."""


def weighed(
    mine: tuple[int, int],
    theirs: tuple[int, int],
    ticks: range,
    length: int,
    decay: float,
    share: float,
) -> tuple[tuple[float, float, float, float], int]:
    """Return what a history makes of a newborn sensor's weights with another.

    Args:
        mine: The rings of the newborn: the ticks at which it would have read on, and
            those at which it would have read off, as bits.
        theirs: Those of the other.
        ticks: The ticks of the history, counted from 0; tick ``t`` is bit ``t %
            length``.
        length: Of the rings.
        decay: What is kept of a weight each time.
        share: The threshold.

    Returns:
        The weights ``w_ij, w_ij*, w_i*j, w_i*j*``, and the code of what follows from
        them; see `neurosnap.poc.learning.pair_codes`. O(ticks) time.
    """
    w11 = w10 = w01 = w00 = 0.25
    code, gain = 0, 1.0 - decay
    # Digits are found faster than bits.
    on, off, theirs_on, theirs_off = (
        f"{ring:0{length}b}"[::-1] for ring in (*mine, *theirs)
    )
    for tick in ticks:
        place = tick % length
        known = theirs_on[place] == "1" or theirs_off[place] == "1"
        bit = on[place] == "1"
        if not known or not (bit or off[place] == "1"):
            continue
        other = theirs_on[place] == "1"
        w11 = _faded(w11, decay, gain if bit and other else 0.0)
        w10 = _faded(w10, decay, gain if bit and not other else 0.0)
        w01 = _faded(w01, decay, gain if not bit and other else 0.0)
        w00 = _faded(w00, decay, gain if not bit and not other else 0.0)
        mixed, like = min(w10, w01), min(w11, w00)
        more, most = max(w10, w01), max(w11, w00)
        equal, opposite = more <= SLACK, most <= SLACK
        loose = not (equal or opposite)
        up = loose and mixed < min(min(more, like), share) - SLACK
        down = loose and like < min(min(most, mixed), share) - SLACK
        code = (1 if w10 < w01 else 2) if up else 0
        code = (4 if w11 < w00 else 8) if down else code
        code = 3 if equal else code
        code = 12 if opposite else code
        shift = mixed if up else (-like if down else 0.0)
        w11, w00 = w11 + shift, w00 + shift
        w10, w01 = w10 - shift, w01 - shift
    return (w11, w10, w01, w00), code


def _faded(weight: float, decay: float, gain: float) -> float:
    """Keep a share of a weight and add what is gained; the least becomes 0."""
    faded = decay * weight + gain
    return faded if faded > TINY else 0.0
