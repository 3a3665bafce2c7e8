"""The result of a run as text, one line per tick, independent of the message format.

Numbers of waves, names of messages and their bytes may change; this may not.
"""

import hashlib
import io
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.protocol.key_frames import snapshot_of, whole
from neurosnap.sensorium import unpack
from tests.golden.drive import Driven, Step
from tests.golden.scenarios import Scenario

Edges = set[tuple[int, int]]
_LONG = 150
_KEPT = wire.KeyFrame, wire.Band


def lines(messages: Iterable[wire.Message], sensors: int) -> list[str]:
    """Return what a swarm came to.

    Args:
        messages: What the world and the coordinator published, in order.
        sensors: How many there are.
    """
    return list(_Telling(sensors).tell(messages))


def meaning_of(scenario: Scenario, lives: Sequence[Driven]) -> list[str]:
    """Return what a scenario came to, the life or the lives of its swarm."""
    seen = (message for life in lives for message in life.seen_by_coordinator())
    told = lines(seen, len(scenario.options.sensors))
    return [*told, learned(lives[-1], scenario.options.learning_shares)]


class _Telling:
    """Gathers what belongs to a tick."""

    def __init__(self, sensors: int) -> None:
        self._sensors = sensors
        self._edges: dict[str, Edges] = {}  # by the part that is wired
        self._wired: Edges = set()  # at the last state wave
        self._asked: list[str] = []
        self._said: list[str] = []

    def tell(self, messages: Iterable[wire.Message]) -> Iterator[str]:
        """Yield a line for each decision."""
        tick = 0
        for message in messages:
            match message:
                case wire.Decision():
                    asked = sorted(set(self._asked))
                    if asked:
                        self._said.append(f"asked {len(asked)} {_short(asked)}")
                    self._said.append(_decided(message))
                    yield f"{message.tick}: {'; '.join(map(_clipped, self._said))}"
                    tick, self._said, self._asked = message.tick, [], []
                case wire.Wiring() | wire.WorkerWiring():
                    self._wire(message)
                case wire.WaveStart(kind="state", repeats=0):
                    self._said += self._rewired()
                case wire.Reached():
                    self._asked.append(f"{message.signal} {message.literals.hex()}")
                case wire.KeyFrame():
                    self._said.append(f"key-frame {message.tick}")
                case wire.Observation() | wire.State() | wire.Anomaly():
                    self._said.append(self._plain(message))
                case _:
                    pass
        yield f"after {tick}: " + "; ".join(self._said)

    def _plain(self, message: wire.Observation | wire.State | wire.Anomaly) -> str:
        match message:
            case wire.Observation():
                bits = unpack(message.bits, self._sensors).tolist()
                known = [True] * self._sensors
                if message.known:
                    known = unpack(message.known, self._sensors).tolist()
                row = (
                    ("1" if bit else "0") if read else "?"
                    for bit, read in zip(bits, known, strict=True)
                )
                flags = {"begins": message.begins, "cut": message.cut}
                named = [name for name, holds in flags.items() if holds]
                return " ".join(["read", "".join(row), *named])
            case wire.State():
                state = unpack(message.literals, 2 * self._sensors).reshape(-1, 2)
                row = ("1" if on else "0" if off else "?" for on, off in state.tolist())
                facts = f"height {message.height} edges {message.edges}"
                clash = " incoherent" * message.incoherent
                return f"state {''.join(row)} {facts} from {message.longest}{clash}"
            case _:
                return _anomalous(message)

    def _wire(self, message: wire.Wiring | wire.WorkerWiring) -> None:
        kept = self._edges.get(message.key, set()) if message.after else set()
        if isinstance(message, wire.WorkerWiring):
            added, dropped = (
                set(zip(flat[::2], flat[1::2], strict=True))
                for raw in (message.add, message.drop)
                for flat in [wire.numbers("edges", raw)]
            )
        else:
            own, other = 2 * message.cell, 2 * message.cell + 1
            added = {(own, b) for b in message.add}
            added |= {(other, b) for b in message.add_complement}
            dropped = {(own, b) for b in message.drop}
            dropped |= {(other, b) for b in message.drop_complement}
        self._edges[message.key] = (kept - dropped) | added

    def _rewired(self) -> list[str]:
        edges: Edges = set().union(*self._edges.values())
        changed = [f"+{a}>{b}" for a, b in sorted(edges - self._wired)]
        changed += [f"-{a}>{b}" for a, b in sorted(self._wired - edges)]
        self._wired = edges
        if len(changed) > 12:
            changed = [f"{len(changed)} changes {_short(changed)}"]
        return [f"wired {' '.join(changed)}"] if changed else []


def _clipped(said: str) -> str:
    """Return what is said, of which the end counts but need not be read."""
    return said if len(said) <= _LONG else f"{said[:_LONG]} ... {_short(said)}"


def _decided(decision: wire.Decision) -> str:
    text = f"decides {decision.action}, {decision.why}"
    if decision.born >= 0:
        text += f"; born {decision.born} = {decision.context}&{decision.literals}"
        text += f" of {decision.history} {_short([decision.weights, decision.codes])}"
    if decision.retires >= 0:
        text += f"; retires {decision.retires}"
    return text + (f"; chance {decision.chance}" if decision.chance else "")


def _anomalous(anomaly: wire.Anomaly) -> str:
    links = ", ".join(
        f"{one.number}:{one.source}>{one.target} {one.support:.9g}/{one.against:.9g}"
        f" since {one.since} on {one.occasions}"
        for one in anomaly.links
    )
    whole = "" if anomaly.exact else " at least"
    return (
        f"anomaly since {anomaly.since} culprits {anomaly.culprits}{whole}"
        f" of {anomaly.candidates} breaks {anomaly.implications}: {links}"
    )


def learned(driven: Driven, shares: Sequence[range]) -> str:
    """Return what was learned by the end: the weights, and what follows from them."""
    snapshot = driven.core.snapshot
    if shares:
        published = [m for m in driven.published if isinstance(m, _KEPT)]
        frame = [m for m in published if isinstance(m, wire.KeyFrame)][-1]
        bands = {
            (m.array, m.offset): m
            for m in published
            if isinstance(m, wire.Band) and m.tick == frame.tick
        }
        every = bands.values()
        snapshot = snapshot_of(whole(frame, every), every, shares)
    literals = range(2 * len(snapshot.sensorium))
    weights = [
        format(snapshot.weight(a, b), ".12g")
        for a in literals
        for b in literals
        if a // 2 < b // 2
    ]
    edges = sorted(map(tuple, np.argwhere(driven.core.graph.hasse()).tolist()))
    return f"learned: weights {_short(weights)}, order {_short(edges)}"


# The same messages out --------------------------------------------------------------


def message_lines(lives: Sequence[Driven]) -> dict[str, list[Step]]:
    """Return what the coordinator published for what it received, tick by tick.

    By a line that has the life of the swarm, the tick, how many messages it received
    then, and a digest of all that it published for each of them.
    """
    found: dict[str, list[Step]] = {}
    for life, driven in enumerate(lives):
        by_tick: dict[int, list[Step]] = {}
        for step in driven.steps:
            by_tick.setdefault(step.tick, []).append(step)
        for tick, steps in by_tick.items():
            digest = _short([[plain(m) for m in step.published] for step in steps])
            found[f"{life} {tick}: {len(steps)} received, {digest}"] = steps
    return found


def plain(message: wire.Message) -> list[Any]:
    """Return the values of a message, without any name that a change may give it.

    An archive counts for the numbers in it; of a band there is a stretch of one only.
    """
    if isinstance(message, wire.Band):
        return [*msgspec.structs.astuple(message)[:-1], bytes(message.data).hex()]
    return [_value(value) for value in msgspec.structs.astuple(message)]


def _value(value: Any) -> Any:
    if isinstance(value, memoryview):
        value = bytes(value)
    if not isinstance(value, bytes):
        return value
    if not value.startswith(b"PK\3\4"):
        return value.hex()
    with zipfile.ZipFile(io.BytesIO(value)) as archive:
        arrays = [
            np.lib.format.read_array(io.BytesIO(archive.read(name)))
            for name in archive.namelist()
        ]
    return [
        [str(array.dtype), list(array.shape), array.tobytes().hex()]
        for array in arrays
        if array.dtype.kind != "U"  # names
    ]


def _short(what: Any) -> str:
    data = msgspec.json.encode(what)
    return hashlib.sha256(data).hexdigest()[:16]
