"""What an agent grows, in lines of text."""

from neurosnap.agent.growth.changed import Changed
from neurosnap.sensorium import visible


def changed_line(changed: Changed) -> str:
    """Return what is said when a sensor is grown, or read no more.

    Example:
        >>> changed_line(Changed(tick=83, sensor=24, name="press&a&b", retires=False))
        'tick 83: grew press&a&b'
    """
    what = "retired" if changed.retires else "grew"
    return visible(f"tick {changed.tick}: {what} {changed.name}")


def grown_text(grown: int, retired: int, room: int) -> str:
    """Return how many sensors were grown, and how many may be.

    Example:
        >>> grown_text(3, 1, 17), grown_text(0, 0, 20), grown_text(1, 0, 0)
        ('3, 1 of them retired; room for 17 more', 'none; room for 20 more', \
'1; no room for more')
    """
    gone = f", {retired} of them retired" if retired else ""
    left = f"room for {room} more" if room else "no room for more"
    return f"{grown or 'none'}{gone}; {left}"
