"""The learning of one worker: its share of the pairs of sensors.

A share begins with nothing learned, or with the bands that the coordinator sends behind
the key-frame that a run goes on from. For later key-frames it sends its own, when told.
"""

from collections.abc import Iterable, Iterator

import msgspec

from neurosnap import wire
from neurosnap.agent.growth import apply_change
from neurosnap.errors import InvalidValueError, MessageError, ShapeError
from neurosnap.poc.learning.snapshot import OF_PAIRS, Changes, Snapshot
from neurosnap.poc.learning.snapshot_bands import Stretch, is_of_share, joined, lacking
from neurosnap.protocol.cell_and_worker_base import check_readings
from neurosnap.protocol.key_frames import HEAD, bands_of, joined_bytes
from neurosnap.sensorium import unpack_readings

PIECE = 1 << 20
"""Bytes of pairs in a message, at most."""
_PAIR = 9  # bytes that a pair takes


class WorkerLearning:
    """Learns one worker's share of pairs, and reports what changed.

    Args:
        worker: Its number.
        snapshot: Of its share; it has learned nothing.
        band: Numbers of an array in one message, at most.
    """

    def __init__(self, worker: int, snapshot: Snapshot, band: int) -> None:
        self._worker = worker
        self._who = f"worker/{worker}"
        self._snapshot = snapshot
        self._band = band
        self._said: list[wire.Learned] = []  # of the last tick learned
        self._bands: dict[tuple[str, int], wire.Band] = {}  # to begin with

    @property
    def tick(self) -> int:
        """What was learned last."""
        return self._snapshot.clock

    def learn(self, message: wire.Learn) -> list[wire.Message]:
        """Learn what is to be learned now; return what changed.

        What is learned already is said once more. Before that it says the bands of a
        key-frame, where they are asked for.

        Raises:
            MessageError: It cannot be right, or something before it was missed: saying
                nothing then makes the coordinator name this worker.
        """
        before = message.tick if message.frame else message.tick - 1
        if message.begins and self._snapshot.clock < before:
            self._begin(message.begins)
        tick = self._snapshot.clock
        if message.tick not in (tick, tick + 1):
            rule = f"must be of tick {tick + 1}"
            raise MessageError(f"learn: {rule}, got tick {message.tick}")
        if message.tick == tick:
            said = self._said or self._pieces(wire.Learn(tick))
            if not message.frame:
                return [*said]
            self._follow(message.changes)
            replace = msgspec.structs.replace
            return [*self.bands(), *(replace(one, frame=tick) for one in said)]
        check_readings(message)
        try:
            bits, known = unpack_readings(
                message.bits, message.known, len(self._snapshot.sensorium)
            )
        except ShapeError as error:
            raise MessageError(f"learn: {error}") from error
        self._follow(message.changes)
        asked = self._evidence(message)
        self._said = []
        self._snapshot.learn(bits, known)
        self._said = self._pieces(message, asked)
        return [*self._said]

    def _follow(self, changes: Iterable[wire.Decision]) -> None:
        """Grow or retire the sensor that comes or goes with the tick learned last.

        Once more changes nothing.
        """
        for change in changes:
            if change.tick == self._snapshot.clock:
                apply_change(None, change, self._snapshot)

    def _pieces(
        self, message: wire.Learn, links: tuple[wire.WeighedLink, ...] = ()
    ) -> list[wire.Learned]:
        """Return what the last observation changed."""
        changes = self._snapshot.changes() if message.bits else None
        pieces = pieces_of(self._worker, message.tick, changes)
        pieces[-1] = msgspec.structs.replace(pieces[-1], links=links)
        return pieces

    def _evidence(self, message: wire.Learn) -> tuple[wire.WeighedLink, ...]:
        """Return what speaks for and against the implications asked for."""
        share, count = self._snapshot.share, len(self._snapshot.sensorium)
        if len(message.sources) != len(message.targets):
            got = f"{len(message.sources)} and {len(message.targets)}"
            raise MessageError(
                f"learn: must have as many sources as targets, got {got}"
            )
        asked = list(zip(message.sources, message.targets, strict=True))
        for pair in asked:
            if max(pair) >= 2 * count or pair[0] >> 1 == pair[1] >> 1:
                rule = f"must be of two of {count} sensors"
                raise MessageError(f"learn: implication {rule}, got {pair}")
        links = []
        for place, pair in enumerate(asked):
            if max(pair) >> 1 in share:
                one = self._snapshot.evidence(*pair)
                both, against = float(one.both), float(one.against)
                link = wire.WeighedLink(place, *pair, both, against, one.since)
                links.append(link)
        return tuple(links)

    def bands(self) -> Iterator[wire.Band]:
        """Yield the bands of a key-frame of the tick learned last."""
        return bands_of(self._snapshot, self._snapshot.clock, self._band, self._who)

    def receive_band(self, band: wire.Band) -> None:
        """Keep a band to begin with, if it is of this share and of a later tick."""
        if band.tick <= self._snapshot.clock:
            return
        if any(other.tick < band.tick for other in self._bands.values()):
            self._bands = {}
        share, count = self._snapshot.share, len(self._snapshot.sensorium)
        of_share = band.array in OF_PAIRS and is_of_share(band.offset, share, count)
        if of_share or band.array == HEAD:
            self._bands[band.array, band.offset] = band

    def _begin(self, size: int) -> None:
        """Begin with the bands that have come; their head has so many bytes.

        Raises:
            MessageError: Some have not, or they make no snapshot.
        """
        head = joined_bytes(HEAD, self._bands.values())
        if len(head) < size:
            raise _lacks(size - len(head))
        self.begin(head)

    def begin(self, head: bytes) -> None:
        """Begin with a head, and the bands that have come.

        Raises:
            MessageError: Some have not, or they make no snapshot.
        """
        own = [band for band in self._bands.values() if band.array in OF_PAIRS]
        share = self._snapshot.share
        try:
            missing = lacking(head, share) - sum(len(band.data) for band in own)
            if missing > 0:
                raise _lacks(missing)
            stretches = (Stretch(one.array, one.offset, one.data) for one in own)
            self._snapshot = joined(head, stretches, share)
        except InvalidValueError as error:
            raise MessageError(f"learn: {error}") from error
        self._bands, self._said = {}, []


def _lacks(missing: int) -> MessageError:
    rule = "must come after the bands to begin with"
    return MessageError(f"learn: {rule}, lacks {missing} bytes of them")


def pieces_of(
    worker: int, tick: int, changes: Changes | None, most: int = PIECE
) -> list[wire.Learned]:
    """Return what changed, if anything did; one message at least.

    A message has so many bytes of pairs at most.
    """
    pieces: list[wire.Learned] = []
    if changes is not None:
        for place in range(0, len(changes.codes), max(1, most // _PAIR)):
            cut = slice(place, place + max(1, most // _PAIR))
            pieces.append(
                wire.Learned(
                    worker,
                    tick,
                    latter=changes.latter[cut].astype("<i4").tobytes(),
                    former=changes.former[cut].astype("<i4").tobytes(),
                    codes=changes.codes[cut].tobytes(),
                )
            )
    pieces = pieces or [wire.Learned(worker, tick)]
    return [
        msgspec.structs.replace(piece, part=part, parts=len(pieces))
        for part, piece in enumerate(pieces)
    ]
