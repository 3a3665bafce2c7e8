"""Where the page is: the same port and token at one start and the next, if that can be.

Links to the page then lead to it after another start, too, in a browser that was let
in before. The file is in the folder that only this user can enter, which the system
empties when it starts or the user logs out.
"""

from contextlib import suppress

import msgspec

from neurosnap.errors import SwarmError
from neurosnap.runtime.registry import own_folder
from neurosnap.system.durable import replace_file

LOOPBACK = "127.0.0.1"

_FILE = "page.json"


class Address(msgspec.Struct, frozen=True):
    """Where a page is, and what lets one in."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """What to open in a browser. Who has it may look at the recording."""
        return f"http://{LOOPBACK}:{self.port}/?token={self.token}"


def kept_address() -> Address | None:
    """Return the address that was kept; None: there is none that can be used."""
    with suppress(OSError, SwarmError, msgspec.MsgspecError):
        kept = msgspec.json.decode((own_folder() / _FILE).read_bytes(), type=Address)
        if 0 < kept.port < 1 << 16 and len(kept.token) >= 32:
            return kept
    return None


def keep_address(address: Address) -> None:
    """Keep an address; where that is not possible, the next start has another."""
    with suppress(OSError, SwarmError):
        replace_file(own_folder() / _FILE, msgspec.json.encode(address))
