"""The run's description that the coordinator sends to joining parts.

So a part on another machine needs only the address of the hub and the id of the swarm,
and no two parts can disagree about the run.
"""

from collections.abc import Collection

import msgspec

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.protocol.resume_point import ResumePoint, first_number
from neurosnap.protocol.run_options import RunOptions

_SHOWN = 8  # names in an error


class RunDescription(msgspec.Struct, frozen=True, kw_only=True):
    """Description of a run."""

    options: RunOptions
    past: ResumePoint | None = None
    """Where it goes on from, where it is taken up again."""
    vacant: tuple[str, ...] = ()
    """The parts that are started elsewhere, by name."""

    def first(self, who: str) -> int:
        """Return the number of the first message of a part."""
        return first_number(self.past, who)

    def check_vacant(self, parts: Collection[str]) -> None:
        """Refuse to start a part that the run does not wait for.

        Raises:
            InvalidValueError: The run has no such part, or starts it itself.
        """
        for who in parts:
            if who not in self.vacant:
                rest = len(self.vacant) - _SHOWN
                more = f" and {rest} more" if rest > 0 else ""
                shown = ", ".join(self.vacant[:_SHOWN]) or "none"
                rule = f"must be one the run leaves to others: {shown}{more}"
                raise InvalidValueError("part", rule, who)

    def to_bytes(self) -> bytes:
        """Return it as JSON. Where the past is recorded is of no use elsewhere."""
        past = self.past
        if past is not None:
            past = msgspec.structs.replace(past, log="")
        return msgspec.json.encode(msgspec.structs.replace(self, past=past))


def read_description(content: bytes) -> RunDescription:
    """Decode a coordinator's description.

    Raises:
        SwarmError: It is no description of a run.
    """
    try:
        return msgspec.json.decode(content, type=RunDescription)
    except msgspec.DecodeError as error:
        raise SwarmError(f"coordinator: must tell what the run is, {error}") from error
