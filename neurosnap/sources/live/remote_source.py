"""A live source in another process, with the messages to and from it.

Messages go over a socket in a folder of the run's own, each behind its length: the
world says which tick it goes on from; then it asks for row after row, and gets each
when there is one.
"""

import contextlib
import socket
import struct
import threading
import time
from typing import BinaryIO, TypeAlias

import msgspec

from neurosnap.errors import NeurosnapError, PartDiedError
from neurosnap.sensorium import unpack
from neurosnap.sources.live.journal import JournalRow
from neurosnap.sources.live.latest_or_late import Bits
from neurosnap.sources.protocol import Observed

_PATIENCE = 20.0  # seconds until the intake answers: it may be coming back
_AGAIN = 0.02  # seconds between two tries


class Ask(msgspec.Struct, frozen=True, array_like=True, tag="ask"):
    """A request for the next row, once `action` is carried out."""

    action: int


class IntakeRecall(msgspec.Struct, frozen=True, array_like=True, tag="recall"):
    """A request for the readings known at the tick from which a world goes on."""

    tick: int


class Over(msgspec.Struct, frozen=True, array_like=True, tag="over"):
    """The answer that the source has no more rows."""


class IntakeFailed(msgspec.Struct, frozen=True, array_like=True, tag="failed"):
    """The answer that the source failed."""

    what: str


Question: TypeAlias = Ask | IntakeRecall
Reply: TypeAlias = JournalRow | Over | IntakeFailed
"""To `IntakeRecall` the row says only what was known."""
HEAD = struct.Struct("<I")
"""The length of a message."""
questions: msgspec.msgpack.Decoder[Question] = msgspec.msgpack.Decoder(Question)
_replies: msgspec.msgpack.Decoder[Reply] = msgspec.msgpack.Decoder(Reply)


def encoded(message: Question | Reply) -> bytes:
    """Return a message behind its length."""
    data = msgspec.msgpack.encode(message)
    return HEAD.pack(len(data)) + data


class RemoteSource:
    """A live `Source` behind a socket.

    Args:
        address: The path of the socket.
        sensors: The names of the sensors.
        actions: The names of the atomic actions, one of which is taken at each step.
    """

    live: bool = True
    discrete: bool = False
    length: int | None = None

    def __init__(
        self, address: str, sensors: tuple[str, ...], actions: tuple[str, ...]
    ) -> None:
        self.sensors = sensors
        self.orders: tuple[int, ...] = (0,) * len(sensors)
        self.actions = actions
        self._address = address
        self._socket: socket.socket | None = None
        self._stream: BinaryIO | None = None
        self._asking = threading.Lock()  # held while an answer is waited for
        self._closed = False

    def resume_after(self, tick: int) -> Bits | None:
        """Let the row after `tick` be the next, before anything is asked.

        Returns:
            Which readings were known at `tick`, ``(N,)``; None if all were.

        Raises:
            NeurosnapError: As `step`.
        """
        match self._ask(IntakeRecall(tick)):
            case IntakeFailed(what=what):
                raise NeurosnapError(what)
            case JournalRow(known=known) if known:
                return unpack(known, len(self.sensors))
            case _:
                return None

    def first(self) -> Observed | None:
        """Return the first row, as `step` does."""
        return self.step(-1)

    def step(self, action: int) -> Observed | None:
        """Return the next row there is, once `action`, the choice, is carried out.

        Returns:
            The readings; None if the source is closed, or over.

        Raises:
            PartDiedError: The intake is gone.
            NeurosnapError: What the source failed of.
        """
        match self._ask(Ask(action)):
            case Over():
                return None
            case IntakeFailed(what=what):
                raise NeurosnapError(what)
            case JournalRow() as row:
                return row.observed(len(self.sensors))

    def close(self) -> None:
        """Wake a waiting caller; from any thread, also twice."""
        self._closed = True
        if self._socket is not None:
            with contextlib.suppress(OSError):  # the other end may be faster
                self._socket.shutdown(socket.SHUT_RDWR)
        with self._asking:
            if self._socket is not None and self._stream is not None:
                self._stream.close()
                self._socket.close()

    def _ask(self, question: Question) -> Reply:
        try:
            with self._asking:
                if self._socket is None:
                    self._socket = self._connected()
                    self._stream = self._socket.makefile("rb")
                if self._closed:
                    return Over()
                self._socket.sendall(encoded(question))
                (length,) = HEAD.unpack(self._read(HEAD.size))
                return _replies.decode(self._read(length))
        except (OSError, EOFError) as error:
            if self._closed:
                return Over()
            rule = "must not end before it is asked to, is gone"
            raise PartDiedError(f"intake: {rule}") from error

    def _connected(self) -> socket.socket:
        until = time.monotonic() + _PATIENCE
        while True:
            end = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            try:
                end.connect(self._address)
            except OSError:
                end.close()
                if self._closed or time.monotonic() > until:
                    raise
                time.sleep(_AGAIN)
            else:
                return end

    def _read(self, count: int) -> bytes:
        """Return the next bytes."""
        data = b"" if self._stream is None else self._stream.read(count)
        if len(data) < count:
            raise EOFError
        return data
