"""Links between hubs, which are in a line, and who loses whom with one."""

from collections.abc import Mapping, Sequence

Link = tuple[tuple[str, str], ...]
"""All pairs of parts that lose each other when it is cut: the far one is second."""


def between(hub: int, at: Mapping[str, int], parts: Sequence[str]) -> Link:
    """Return the link in front of a hub.

    Args:
        hub: Its place in the line, from 1.
        at: The place of each part's hub.
        parts: Those that count.
    """
    near = [who for who in parts if at[who] < hub]
    far = [who for who in parts if at[who] >= hub]
    return tuple((one, other) for one in near for other in far)
