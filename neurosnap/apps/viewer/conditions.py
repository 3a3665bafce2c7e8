"""What each sensor was at a tick, by what was read and what the state holds."""

from contextlib import suppress

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
        held = unpack(state.literals, 2 * count)
    except ShapeError:
        return found  # it is of other sensors
    on, off = held.reshape(-1, 2).T
    read = ticks.literals(tick).reshape(-1, 2).any(axis=1)
    against = ticks.contradicted(state, held)
    if state.incoherent and not (on | off | against).all():
        # Others may say of a sensor that was not read that it is on, and that it is
        # off; `ticks` may be without waves.
        with suppress(RecordingError):
            waves = Ticks(view.tick_index, view.options, tick, tick)
            against = waves.contradicted(state, held)
    found[:] = np.where(against, CONTRADICTED, UNKNOWN)
    found[on] = np.where(read, ON, ON_PREDICTED)[on]
    found[off] = np.where(read, OFF, OFF_PREDICTED)[off]
    return found
