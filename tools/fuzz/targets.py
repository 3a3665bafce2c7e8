"""The targets of fuzzing, and the rule each must keep.

What a target says can be read by others and comes soon; and next to a twin that got the
honest input alone, a core that was given what it rejects goes on saying the same.
"""

import copy
import random
import re
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import msgspec

from neurosnap import wire
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_shares import shares
from neurosnap.recording.format.chunk_index import unpack
from neurosnap.recording.format.cuts_and_damage import scan_index
from neurosnap.recording.format.records import opened
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.parts.job import decoded
from neurosnap.sources.open_readings import open_readings
from tests.support.memory_hubs import run_out
from tools.fuzz.altered_bytes import damage, damage_json, damage_recording
from tools.fuzz.messages import altered, message
from tools.fuzz.run import SENSORS, WORKERS, Honest, honest_bag

_SLOWEST = 2.0  # seconds of computing an input may cost
_LONGEST = 1000  # characters of a fault
_KEYS = (*wire.TOPICS, "wavestart/1", "pulse/0/cell/1", "wiring/3", "x" * 9000, "/")
_GAP = re.compile(r"(wiring|workerwiring): must build on epoch")


class FuzzError(Exception):
    """A target did what it must not do."""


def check_readable(said: Sequence[wire.Message]) -> None:
    """Refuse what a part says and others cannot read."""
    for one in said:
        if wire.decode(one.key, wire.encode(one)) != one:
            raise FuzzError(f"said what comes out as something else: {one!r:.500}")
        if isinstance(one, wire.Fault) and len(one.what) > _LONGEST:
            raise FuzzError(f"said a fault of {len(one.what)} characters")


@dataclass
class Count:
    """What came of the inputs of one target, and the input in hand."""

    inputs: int = 0
    rejected: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    grown: int = 0
    last: object = field(default=None, repr=False)

    def timed(self, given: object, call: Callable[[], Any]) -> Any:  # noqa: ANN401
        """Return what `call` makes of `given`, unless it takes too long."""
        self.inputs += 1
        self.last = given
        began = time.thread_time()
        result = call()
        took = time.thread_time() - began
        self.slowest = max(self.slowest, took)
        if took > _SLOWEST:
            raise FuzzError(f"took {took:.1f} s")
        return result


Target = Callable[[random.Random, Count], None]
"""A round of something that reads what others wrote: some hundred drawn inputs."""


def decode(honest: Honest, chance: random.Random, count: Count) -> None:
    """Decode damaged payloads as parts do: a message or one fault comes of each."""
    hub = MemoryHub()
    part = hub.fabric("cell/1")
    faults: list[wire.Delivery] = []
    hub.fabric("ear").listen(("fault/**",), faults.extend)
    for _ in range(250):
        first, other = (wire.encode(message(chance)) for _ in range(2))
        if chance.random() < 0.3:
            first = chance.choice(honest.deliveries).payload
        payload = damage_json(first, other, chance)
        key = chance.choice(_KEYS)
        tag = re.search(rb'"type":"(\w+)"', payload)
        if tag is not None and chance.random() < 0.8:
            key = _own_key(tag[1].decode(), payload, key)
        delivery = wire.Delivery(key, 0, 0, payload)
        read = count.timed(delivery, partial(decoded, part, [delivery]))
        run_out(hub)
        said = [wire.decode(fault.key, fault.payload) for fault in faults]
        faults.clear()
        if len(read) + len(said) != 1:
            raise FuzzError(f"made {len(read)} messages, {len(said)} faults of one")
        check_readable([*read, *said])
        count.rejected += len(said)


def _own_key(topic: str, payload: bytes, otherwise: str) -> str:
    """Return the key the payload would have to come under."""
    if topic not in wire.TOPICS:
        return otherwise
    try:
        return msgspec.json.decode(payload, type=wire.TOPICS[topic]).key
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return topic


class Core(Protocol):
    """A part's core: what it says is a function of what it was told."""

    def receive(self, given: Any, /) -> list[wire.Message]:  # noqa: ANN401
        """Take in what is given."""
        ...


class Twins:
    """A core that gets the honest input alone, and one that is meddled with.

    Args:
        core: New.
        script: The honest input, in order.
        burst: What the core's `receive` takes for one message.
        after: How much of the script a core that took a hostile message goes on with:
            harm may come of it only then.
    """

    def __init__(
        self,
        core: Core,
        script: Sequence[wire.Message],
        burst: Callable[[wire.Message], object] = lambda m: m,
        after: int = 0,
    ) -> None:
        self._clean = core
        self._kept, self._since = copy.deepcopy(core), list[object]()
        self._tried = copy.deepcopy(core)
        self._abused = copy.deepcopy(core)
        self._script = script
        self._burst = burst
        self._after = after

    def play(self, chance: random.Random, count: Count, most: int) -> None:
        """Go through the script, up to `most` hostile inputs before each message."""
        for past, honest in enumerate(self._script):
            for _ in range(chance.randrange(most)):
                self._meddle(chance, count, past)
            given = self._burst(honest)
            expected, got = self._clean.receive(given), self._tried.receive(given)
            self._since.append(given)
            self._abused.receive(given)
            if got != expected:
                raise FuzzError(f"said {got!r:.500} and not {expected!r:.500}")

    def _meddle(self, chance: random.Random, count: Count, come: int) -> None:
        # What was learned is said again to whoever asks.
        came, kind = self._script[:come], chance.random()
        past: list[wire.Message]
        past = [one for one in came if not isinstance(one, wire.Learn)]
        again = bool(past) and kind < 0.15
        if again:
            hostile = chance.choice(past)
        elif kind < 0.8:
            hostile = altered(chance.choice(self._script), chance)
        else:
            hostile = message(chance)
        given = self._burst(hostile)
        said = count.timed(hostile, partial(self._tried.receive, given))
        check_readable(said)
        check_readable(self._abused.receive(given))
        faults = [one.what for one in said if isinstance(one, wire.Fault)]
        if again and len(faults) != len(said):
            raise FuzzError(f"answered again: {said!r:.500}")
        # A part whose wirings have a gap falls silent until it is wired anew: a change
        # that was lost looks the same.
        gap = any(map(_GAP.match, faults))
        if again or (said and len(faults) == len(said) and not gap):
            count.rejected += 1
        else:
            for honest in self._script[come : come + self._after]:
                check_readable(self._tried.receive(self._burst(honest)))
            self._tried = self._copied()

    def _copied(self) -> Core:
        """Return a core that is as the clean one is.

        A tick under way, which is a generator, cannot be copied: so it is gone through
        again, from where the core could be copied last.
        """
        with suppress(TypeError):
            self._kept = copy.deepcopy(self._clean)
            self._since = []
        core = copy.deepcopy(self._kept)
        for given in self._since:
            core.receive(given)
        return core


def cell(honest: Honest, chance: random.Random, count: Count) -> None:
    """Take a cell through what it heard in the run."""
    number = chance.randrange(SENSORS)
    script = honest.heard_by(wire.cell_keys(number))
    Twins(Cell(number), script, lambda m: [m]).play(chance, count, 16)


def worker(honest: Honest, chance: random.Random, count: Count) -> None:
    """Take a worker through what it heard in a run that shared the learning, too.

    Compiled loops do not look where they index. With ``NUMBA_BOUNDSCHECK=1`` they do,
    and ``NUMBA_CACHE_DIR`` then has to name a folder of its own.
    """
    number = chance.randrange(WORKERS)
    script = honest.heard_by(wire.worker_keys(number))
    learning = honest.options.new_worker_learning(number)
    core = Worker(number, shares(SENSORS, WORKERS), learning)
    # A burst ahead of its wave is not looked at more closely until that begins.
    twins = Twins(core, script, lambda m: [m], after=len(script))
    twins.play(chance, count, 16)


def coordinator(runs: Sequence[Honest], chance: random.Random, count: Count) -> None:
    """Take the coordinator through what it heard in a run of cells, or of workers."""
    honest = chance.choice(runs)
    topics = ("observation", "cellreport", "workerreport", "learned")
    core = Coordinator(honest.options)
    core.begin()
    Twins(core, honest.heard_by(topics)).play(chance, count, 40)


def recording(
    honest: Honest, folder: Path, chance: random.Random, count: Count
) -> None:
    """Read damaged recordings: each to its end, or it is refused by name."""
    path, whole = folder / "hostile.mcap", honest.recording
    for _ in range(25):
        if chance.random() < 0.3:
            file = damage(whole, whole, chance)
        else:  # below its checksums
            file = damage_recording(whole, chance)
        path.write_bytes(file)
        try:
            count.timed(file, partial(_read, path))
        except RecordingError:
            count.rejected += 1


def _read(path: Path) -> None:
    # As a viewer does, which shows what it can.
    with suppress(RecordingError), opened(path) as file:
        for chunk in scan_index(path).chunks:
            with suppress(RecordingError):
                unpack(path, file, chunk)
    found = Recording.open(path)
    list(render(describe(found)))
    found.balance(found.sequences())
    for topic in wire.TOPICS:  # what lacks it is skipped, by the indexes
        list(found.messages((topic,)))
    _ = found.files[0].share, found.closing


def bag(folder: Path, chance: random.Random, count: Count) -> None:
    """Read damaged bags of other programs: each to its end, or it is refused."""
    path, whole = folder / "hostile.mcap", honest_bag()
    for _ in range(25):
        if chance.random() < 0.3:
            file = damage(whole, whole, chance)
        else:
            file = damage_recording(whole, chance)
        path.write_bytes(file)
        try:
            count.timed(file, partial(open_readings, str(path)))
        except InvalidValueError:
            count.rejected += 1
