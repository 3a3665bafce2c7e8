"""Splits large key-frames into pieces on the wire, and reassembles them.

No session takes in a message of more than `LARGEST` bytes: what is larger is dropped
before it is put together, so that no message can fill the memory of a hub or a part.
One kind of ours grows with the square of the sensors, the key-frame. It travels in
pieces, one after the other, with one running number; a reader gets it whole.
"""

import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING

from neurosnap import wire
from neurosnap.errors import FabricError

if TYPE_CHECKING:
    import zenoh

LARGEST = 1 << 24
"""Bytes of a message that a session takes in."""

_PIECED = "keyframe"
_PIECE = LARGEST // 2
_WHOLE = LARGEST - (1 << 16)  # bytes of a payload; its key goes beside it
_MANY = wire.LARGEST_KEYFRAME // _PIECE

_BESIDE = struct.Struct("<QQ")  # running number, sender's clock in ns
_BESIDE_A_PIECE = struct.Struct("<QQII")  # and which piece it is, of how many


def pieces(delivery: wire.Delivery) -> Sequence[tuple[bytes, bytes]]:
    """Return the pieces of a message: payloads, each with its attachment.

    Raises:
        FabricError: No session would take it in.
    """
    key, number, sent, payload = delivery
    if key != _PIECED or len(payload) <= _PIECE:
        if len(payload) > _WHOLE:
            rule = f"must have at most {_WHOLE:,} bytes, got {len(payload):,}"
            raise FabricError(f"message on {key}: {rule}")
        return ((payload, _BESIDE.pack(number, sent)),)
    count = -(-len(payload) // _PIECE)
    return [
        (
            payload[index * _PIECE : (index + 1) * _PIECE],
            _BESIDE_A_PIECE.pack(number, sent, index, count),
        )
        for index in range(count)
    ]


class Assembly:
    """Reassembles the messages of one subscription that came in pieces.

    A piece that is out of turn ends what it does not belong to: then the message is
    lost, which shows in its sender's numbers. Only one message is in hand at a time.

    Args:
        cut: Characters of the keys that are the swarm's prefix.
    """

    def __init__(self, cut: int) -> None:
        self._cut = cut
        self._head: tuple[int, int, int] | None = None  # number, clock, pieces
        self._parts: list[bytes] = []

    def receive(self, sample: "zenoh.Sample") -> wire.Delivery | None:
        """Return the delivery that a sample completes; None if it completes none.

        It is copied out of Zenoh's hands. A stranger's sample is dropped.
        """
        beside = sample.attachment
        if beside is None:
            return None
        raw, key = beside.to_bytes(), str(sample.key_expr)[self._cut :]
        if len(raw) == _BESIDE.size:
            number, sent = _BESIDE.unpack(raw)
            return wire.Delivery(key, number, sent, sample.payload.to_bytes())
        if len(raw) != _BESIDE_A_PIECE.size or key != _PIECED:
            return None
        number, sent, index, count = _BESIDE_A_PIECE.unpack(raw)
        head = (number, sent, count)
        if index == 0:
            self._head, self._parts = head, []
        if head != self._head or index != len(self._parts) or count > _MANY:
            self._head, self._parts = None, []
            return None
        self._parts.append(sample.payload.to_bytes())
        if len(self._parts) < count:
            return None
        whole = b"".join(self._parts)
        self._head, self._parts = None, []
        return wire.Delivery(key, number, sent, whole)
