"""The location of a part: its host and process id, as announced by itself."""

import os
import re
import socket
from typing import NamedTuple, Self

_LONGEST = 64  # characters of a machine's name, as many as Linux lets it have
_STRANGE = re.compile(r"[^A-Za-z0-9._-]")
_TEXT = re.compile(rf"([A-Za-z0-9._-]{{1,{_LONGEST}}})/([0-9]{{1,10}})")


class Place(NamedTuple):
    """A process on a machine."""

    host: str
    """The machine's name: up to 64 letters, digits, dots, dashes and underscores."""
    pid: int

    @classmethod
    def here(cls) -> Self:
        """Return this process. What a name may not hold is a dash in it."""
        name = _STRANGE.sub("-", socket.gethostname())[:_LONGEST]
        return cls(name or "-", os.getpid())

    @classmethod
    def read(cls, text: str) -> Self | None:
        """Return the place in `text`, which may be a stranger's; None: it is none.

        Example:
            >>> Place.read("oak.lan/4711")
            Place(host='oak.lan', pid=4711)
        """
        found = _TEXT.fullmatch(text)
        return None if found is None else cls(found[1], int(found[2]))

    @property
    def text(self) -> str:
        """The place as a part of a key, and as it is recorded."""
        return f"{self.host}/{self.pid}"
