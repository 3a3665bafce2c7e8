"""Log lines of a run's faults and departures, for Foxglove's log panel."""

from typing import Any, TypeAlias

from neurosnap import wire
from neurosnap.agent.growth.changed import Changed
from neurosnap.apps.export.foxglove_scene import stamp
from neurosnap.apps.growth_text import changed_line
from neurosnap.protocol.anomaly_messages import anomaly_line, told

Line: TypeAlias = dict[str, Any]
"""A ``foxglove.Log``."""

_INFO, _WARNING, _ERROR = 2, 3, 4


def line_of(message: wire.Message, sensors: tuple[str, ...], time: int) -> Line | None:
    """Return what a message tells people; None: nothing.

    Args:
        message: Of any kind.
        sensors: The names of the run's sensors.
        time: Nanoseconds since the epoch.

    Raises:
        MessageError: It is an anomaly, but not of such sensors.
    """
    match message:
        case wire.Fault(who=who, what=what):
            return _line(time, _ERROR, who, what)
        case wire.Leave(who=who):
            return _line(time, _INFO, who, "left")
        case wire.Anomaly():
            return _line(
                time, _WARNING, message.sender, anomaly_line(told(message, sensors))
            )
        case wire.Decision(tick=tick, born=born, retires=retires):
            said = [
                changed_line(Changed(tick, sensor, sensors[sensor], gone))
                for sensor, gone in ((born, False), (retires, True))
                if 0 <= sensor < len(sensors)
            ]
            return _line(time, _INFO, message.sender, "; ".join(said)) if said else None
        case _:
            return None


def resumed_line(time: int, tick: int) -> Line:
    """Return what is said of a run that was taken up again after a tick."""
    return _line(time, _INFO, "coordinator", f"goes on after tick {tick}")


def lost_line(time: int, tick: int) -> Line:
    """Return what is said where an observation is missing."""
    said = (
        f"the observation of tick {tick} is missing:"
        " no order is drawn up to the next key-frame"
    )
    return _line(time, _ERROR, "export", said)


def _line(time: int, level: int, who: str, text: str) -> Line:
    return {
        "timestamp": stamp(time),
        "level": level,
        "message": text,
        "name": who,
        "file": "",
        "line": 0,
    }
