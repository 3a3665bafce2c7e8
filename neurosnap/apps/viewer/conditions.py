"""What each sensor was at a tick, by what was read and what the state holds."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import Ticks
from neurosnap.errors import RecordingError, ShapeError
from neurosnap.sensorium import unpack

NOT_RECORDED, UNKNOWN, OFF, ON, OFF_PREDICTED, ON_PREDICTED, CONTRADICTED = range(7)
"""Predicted: not read, but the state has it. Contradicted: the wave reached both
literals, so that the state has neither. Unknown: it reached none."""


def conditions(view: RunView, ticks: Ticks, tick: int) -> NDArray[np.uint8]:
    """Return what each sensor was at a tick.

    Args:
        view: The run; it is asked for the wave where only that can tell.
        ticks: Messages of the run, of this tick, too.
        tick: Which.

    Returns:
        ``(N,)``, one of the constants of this module for each sensor.
    """
    count = view.options.body.count
    found = np.full(count, NOT_RECORDED, np.uint8)
    state = ticks.states.get(tick)
    if state is None:
        return found
    try:
        held = unpack(state.literals, 2 * count).reshape(-1, 2)
    except ShapeError:
        return found  # it is of other sensors
    read = ticks.literals(tick).reshape(-1, 2).any(axis=1)
    on, off = held.T
    neither = ~on & ~off
    found[neither] = np.where(read, CONTRADICTED, UNKNOWN)[neither]
    found[on] = np.where(read, ON, ON_PREDICTED)[on]
    found[off] = np.where(read, OFF, OFF_PREDICTED)[off]
    # Others may say of a sensor that was not read that it is on, and that it is off.
    open_ones = np.flatnonzero(neither & ~read)
    if state.incoherent and len(open_ones):
        reached = _reached(view, tick, state.wave, 2 * count).reshape(-1, 2)
        found[open_ones[reached[open_ones].all(axis=1)]] = CONTRADICTED
    return found


def _reached(view: RunView, tick: int, wave: int, literals: int) -> NDArray[np.bool_]:
    """Return the literals that a tick's wave reached, as far as is known."""
    found = np.zeros(literals, np.bool_)
    try:
        ticks = Ticks(view.tick_index, view.options, tick, tick)
    except RecordingError:
        return found
    found[ticks.reached(wave)] = True
    return found
