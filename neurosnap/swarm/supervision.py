"""What happens when a part of a run dies; no part of what the run comes to."""

from typing import Annotated, Literal, TypeAlias

import msgspec

RestartKind: TypeAlias = Literal["never", "on-failure", "always"]


class Supervision(msgspec.Struct, frozen=True, kw_only=True):
    """What happens when a part dies."""

    restart: RestartKind = "on-failure"
    """Whether the run goes on. ``on-failure``: when a part was killed or vanished, and
    not when one says why it cannot go on, since it would say the same again.
    ``always``: then, too."""
    max_restarts: Annotated[int, msgspec.Meta(ge=0)] = 10
    """How often, before the run is given up."""
    backoff: Annotated[float, msgspec.Meta(ge=0)] = 0.1
    """Seconds before a restart; twice as many each time no tick was gained."""
