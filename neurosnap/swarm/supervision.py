"""What happens when a part of a run dies; no part of what the run comes to."""

from typing import Annotated, Literal, TypeAlias

import msgspec

RestartKind: TypeAlias = Literal["never", "on-failure"]


class Supervision(msgspec.Struct, frozen=True, kw_only=True):
    """What happens when a part dies."""

    restart: RestartKind = "on-failure"
    """Whether the run goes on. A part that says why it cannot go on is not started
    again: it would say the same."""
    max_restarts: Annotated[int, msgspec.Meta(ge=0)] = 10
    """How often, before the run is given up."""
    backoff: Annotated[float, msgspec.Meta(ge=0)] = 0.1
    """Seconds before a restart; twice as many each time no tick was gained."""
