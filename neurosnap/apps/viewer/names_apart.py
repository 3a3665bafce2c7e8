"""Short names of files that tell them apart."""

from collections.abc import Sequence
from pathlib import Path


def told_apart(paths: Sequence[Path]) -> list[str]:
    """Return for each path as much of its end as no other path has.

    Example:
        >>> told_apart([Path("/a/run.mcap"), Path("/b/run.mcap"), Path("/b/x.mcap")])
        ['a/run.mcap', 'b/run.mcap', 'x.mcap']
    """
    parts = [path.absolute().parts for path in paths]
    return [
        next(
            (
                "/".join(own[-count:])
                for count in range(1, len(own))
                if sum(one[-count:] == own[-count:] for one in parts) == 1
            ),
            str(path),
        )
        for path, own in zip(paths, parts, strict=True)
    ]
