"""The learning of one worker: its share of the pairs of sensors.

A share begins with nothing learned, or with the bands that the coordinator sends behind
the key-frame that a run goes on from. For later key-frames it sends its own, when told.
"""

from collections.abc import Iterator

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError, ShapeError
from neurosnap.poc.learning.pairs import pairs_of
from neurosnap.poc.learning.snapshot import OF_PAIRS, Changes, Snapshot
from neurosnap.poc.learning.snapshot_bands import Stretch, joined, lacking
from neurosnap.protocol.cell_and_worker_base import check_readings
from neurosnap.protocol.key_frames import bands_of
from neurosnap.sensorium import unpack_readings

PIECE = 1 << 20
"""Bytes of codes in a message, at most, but for a row that has more."""
_SINGLE = 9  # bytes that a single pair takes


class WorkerLearning:
    """Learns one worker's share of pairs, and reports what changed.

    Args:
        worker: Its number.
        snapshot: Of its share; it has learned nothing.
        shares: Those of all workers.
        band: Numbers of an array in one message, at most.
    """

    def __init__(
        self, worker: int, snapshot: Snapshot, shares: list[range], band: int
    ) -> None:
        self._worker = worker
        self._who = f"worker/{worker}"
        self._snapshot = snapshot
        self._shares = shares
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
            self.begin(message.begins)
        tick = self._snapshot.clock
        if message.tick not in (tick, tick + 1):
            rule = f"must be of tick {tick + 1}"
            raise MessageError(f"learn: {rule}, got tick {message.tick}")
        if message.tick == tick:
            said = self._said or self._pieces(wire.Learn(tick))
            if not message.frame:
                return [*said]
            replace = msgspec.structs.replace
            return [*self.bands(), *(replace(one, frame=tick) for one in said)]
        self._said = []
        check_readings(message)
        try:
            bits, known = unpack_readings(
                message.bits, message.known, len(self._snapshot.sensorium)
            )
        except ShapeError as error:
            raise MessageError(f"learn: {error}") from error
        asked = self._evidence(message)
        self._snapshot.learn(bits, known)
        self._said = self._pieces(message, asked)
        return [*self._said]

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
        args = self._snapshot.clock, self._band, self._who, self._shares
        return bands_of(self._snapshot, *args)

    def receive_band(self, band: wire.Band) -> None:
        """Keep a band to begin with, if it is of this share and of a later tick."""
        if band.tick <= self._snapshot.clock or band.array not in OF_PAIRS:
            return
        if any(other.tick < band.tick for other in self._bands.values()):
            self._bands = {}
        every = len(pairs_of(range(len(self._snapshot.sensorium))))
        if band.offset % max(1, every) in pairs_of(self._snapshot.share):
            self._bands[band.array, band.offset] = band

    def begin(self, head: bytes) -> None:
        """Begin with the bands that have come; the head is of their key-frame.

        Raises:
            MessageError: Some have not, or they make no snapshot.
        """
        bands, share = self._bands.values(), self._snapshot.share
        try:
            missing = lacking(head, share) - sum(len(band.data) for band in bands)
            if missing > 0:
                rule = "must come after the bands to begin with"
                raise MessageError(f"learn: {rule}, lacks {missing} bytes of them")
            stretches = (Stretch(one.array, one.offset, one.data) for one in bands)
            self._snapshot = joined(head, stretches, share)
        except InvalidValueError as error:
            raise MessageError(f"learn: {error}") from error
        self._bands, self._said = {}, []


def pieces_of(
    worker: int, tick: int, changes: Changes | None, most: int = PIECE
) -> list[wire.Learned]:
    """Return what changed, if anything did; one message at least.

    A message has so many bytes of codes at most, but for a row that has more.
    """
    pieces: list[wire.Learned] = []
    if changes is not None:
        ends = np.cumsum((changes.rows + 1) // 2)
        begin = 0
        while begin < len(ends):
            before = ends[begin - 1] if begin else 0
            end = max(begin + 1, int(np.searchsorted(ends, before + most, "right")))
            rows = changes.rows[begin:end].astype("<i4").tobytes()
            codes = changes.packed[before : ends[end - 1]].tobytes()
            pieces.append(wire.Learned(worker, tick, rows=rows, codes=codes))
            begin = end
        for place in range(0, len(changes.codes), max(1, most // _SINGLE)):
            cut = slice(place, place + max(1, most // _SINGLE))
            pieces.append(
                wire.Learned(
                    worker,
                    tick,
                    latter=changes.latter[cut].astype("<i4").tobytes(),
                    former=changes.former[cut].astype("<i4").tobytes(),
                    single=changes.codes[cut].tobytes(),
                )
            )
    pieces = pieces or [wire.Learned(worker, tick)]
    return [
        msgspec.structs.replace(piece, part=part, parts=len(pieces))
        for part, piece in enumerate(pieces)
    ]
