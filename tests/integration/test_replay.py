"""A recorded run derived again: told from a tampered one, taken up where it ended."""

import asyncio
import itertools
import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.depth.measure import from_recording
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.fabric.in_memory import MemoryFabric, MemoryHub
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions, SnapshotKind, WiringKind
from neurosnap.recording.read.learned_at import snapshot_at
from neurosnap.recording.read.reader import Recorded, Recording
from neurosnap.recording.read.stretches import last_tick
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import Verdict, verify
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.run import Outcome, describe, run
from neurosnap.sensorium import pack, unpack
from neurosnap.sources.open import open_source

pytestmark = pytest.mark.slow

PATH = "neurosnap/Path-v0"
TICKS = 30
SEED = 5

M = TypeVar("M")
Change: TypeAlias = Callable[[list[Recorded]], Iterable[Recorded]]


def readings(rows: int = 60) -> list[list[bool]]:
    """Return rows in which `a` and `b` are equivalent and imply `c`, until they do not.

    Both exceptions come once the rule is learned, so they are incoherent observations.
    """
    chance = random.Random(7)
    table = []
    for tick in range(1, rows + 1):
        a, either, free = (chance.random() < 0.5 for _ in range(3))
        row = [a, a, a or either, not a, free]
        if tick == 19:
            row = [True, False, True, False, free]
        if tick == 24:
            row = [True, True, False, True, free]
        table.append(row)
    return table


def write_csv(path: Path, rows: Iterable[Sequence[bool]]) -> str:
    lines = ["a,b,c,d,e", *(",".join(str(int(bit)) for bit in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def options_for(
    source: str,
    wiring: WiringKind = "hasse",
    snapshot: SnapshotKind = "empirical",
    *,
    ticks: int = TICKS,
) -> RunOptions:
    opened = open_source(source, SEED)
    opened.close()
    return RunOptions(
        source=source,
        body=Body(own=opened.sensors, actions=opened.actions),
        ticks=ticks,
        seed=SEED,
        snapshot=snapshot,
        # Coarse enough that either snapshot learns within a few ticks, and that one
        # exception does not unlearn it.
        threshold=0.08 if snapshot == "empirical" else 0.15,
        decay=None if snapshot == "empirical" else 0.9,
        wiring=wiring,
        cells="inline",
        keyframe_every=7,
    )


def recorded_run(
    options: RunOptions,
    log: Path,
    *,
    past: ResumePoint | None = None,
    stop_at: int | None = None,
) -> Outcome:
    """Make an inline run, asked to stop once `stop_at` ticks are whole."""

    async def work() -> Outcome:
        stop = asyncio.Event()

        def on_progress(tick: int) -> None:
            if stop_at is not None and tick >= stop_at:
                stop.set()

        return await run(options, log, stop, on_progress, past)

    return asyncio.run(work())


def resumed_run(log: Path, new: Path, ticks: int) -> Outcome:
    options, past = find_resume_point(log)
    return recorded_run(msgspec.structs.replace(options, ticks=ticks), new, past=past)


class Run(NamedTuple):
    log: Path
    options: RunOptions
    outcome: Outcome


class Runs:
    """Runs of this module, each made once."""

    def __init__(self, folder: Path) -> None:
        self.csv = write_csv(folder / "readings.csv", readings())
        self._folder = folder
        self._made: dict[bytes, Run] = {}

    def of(
        self,
        name: str,
        wiring: WiringKind = "hasse",
        snapshot: SnapshotKind = "empirical",
        *,
        ticks: int = TICKS,
    ) -> Run:
        source = PATH if name == "path" else self.csv
        options = options_for(source, wiring, snapshot, ticks=ticks)
        key = msgspec.json.encode(options)
        made = self._made.get(key)
        if made is None:
            log = self._folder / f"{len(self._made)}.mcap"
            made = Run(log, options, recorded_run(options, log))
            self._made[key] = made
        return made


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


EVERY_RUN = [
    (name, wiring, snapshot)
    for name in ("path", "csv")
    for wiring in ("hasse", "derived")
    for snapshot in ("empirical", "discounted")
]
every_run = pytest.mark.parametrize(("name", "wiring", "snapshot"), EVERY_RUN)


# Recordings rewritten -----------------------------------------------------------------


def of_type(log: Path, kind: type[M]) -> list[M]:
    messages = (recorded.message for recorded in Recording.open(log).messages())
    return [message for message in messages if isinstance(message, kind)]


def write_again(
    recording: Recording,
    target: Path,
    recorded: Iterable[Recorded],
    *,
    expected: Mapping[str, int] | None = None,
    chunk: int = 1 << 20,
) -> Path:
    """Record `recorded` as if it had come from the run of `recording`."""
    with Writer(target, chunk=chunk) as writer:
        writer.start(recording.metadata)
        for each in recorded:
            writer.add(each.delivery, each.log_time)
        writer.finish({}, recording.noted().expected if expected is None else expected)
    return target


def rewritten(log: Path, target: Path, change: Change) -> Path:
    recording = Recording.open(log)
    return write_again(recording, target, change(list(recording.messages())))


def saying(recorded: Recorded, **changes: object) -> Recorded:
    """Return `recorded` with its message changed, at the same place and number."""
    message: wire.Message = msgspec.structs.replace(recorded.message, **changes)
    return recorded._replace(message=message, payload=wire.encode(message))


def flipped(data: bytes, bit: int = 0) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def changing(
    kind: type[M], found: Callable[[M], bool], to: Callable[[M], dict[str, object]]
) -> Change:
    """Return the change of the first message of one kind of which `found` is true."""

    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, message = first(recorded, kind, found)
        recorded[place] = saying(recorded[place], **to(message))
        return recorded

    return change


def first(
    recorded: Sequence[Recorded], kind: type[M], found: Callable[[M], bool]
) -> tuple[int, M]:
    for place, each in enumerate(recorded):
        if isinstance(each.message, kind) and found(each.message):
            return place, each.message
    raise LookupError(f"no {kind.__name__} like that")


def wave_of(recorded: Iterable[Recorded], tick: int) -> int:
    states = (each.message for each in recorded)
    return next(s.wave for s in states if isinstance(s, wire.State) and s.tick == tick)


def change_report(recorded: list[Recorded]) -> list[Recorded]:
    """Let a cell report its complement in tick 12's state wave."""
    wave = wave_of(recorded, 12)
    place, report = first(
        recorded, wire.CellReport, lambda s: s.wave == wave and len(s.literals) == 1
    )
    recorded[place] = saying(recorded[place], literals=(report.literals[0] ^ 1,))
    return recorded


def swap_states(recorded: list[Recorded]) -> list[Recorded]:
    """Swap what the states of ticks 12 and 13 say, their numbers left in order."""
    (a, one), (b, other) = (
        first(recorded, wire.State, lambda s, tick=tick: s.tick == tick)  # type: ignore[misc]
        for tick in (12, 13)
    )
    recorded[a] = saying(recorded[a], literals=other.literals)
    recorded[b] = saying(recorded[b], literals=one.literals)
    return recorded


def swap_places(recorded: list[Recorded]) -> list[Recorded]:
    """Swap the states of ticks 12 and 13 in the file."""
    (a, _), (b, _) = (
        first(recorded, wire.State, lambda s, tick=tick: s.tick == tick)  # type: ignore[misc]
        for tick in (12, 13)
    )
    recorded[a], recorded[b] = recorded[b], recorded[a]
    return recorded


def change_wiring(recorded: list[Recorded]) -> list[Recorded]:
    """Let one of a wiring's targets be another."""
    place, wiring = first(recorded, wire.Wiring, lambda w: len(w.add) > 0)
    recorded[place] = saying(recorded[place], add=(wiring.add[0] ^ 1, *wiring.add[1:]))
    return recorded


def close_up(recorded: list[Recorded]) -> list[Recorded]:
    """Take a report of tick 12 out so that no number shows it."""
    wave = wave_of(recorded, 12)
    place, report = first(recorded, wire.CellReport, lambda s: s.wave == wave)
    gone = recorded.pop(place)
    return [
        each._replace(sequence=each.sequence - 1)
        if each.message.sender == report.sender and each.sequence > gone.sequence
        else each
        for each in recorded
    ]


TAMPERED: dict[str, tuple[Change, str]] = {
    "observation": (
        changing(
            wire.Observation,
            lambda o: o.tick == 12,
            lambda o: {"bits": flipped(o.bits, 1)},
        ),
        r"tick 12: /(wiring|wave|state) ",
    ),
    "observation's length": (
        changing(
            wire.Observation, lambda o: o.tick == 12, lambda o: {"bits": o.bits + b"1"}
        ),
        r"tick 12: /observe: ",
    ),
    "state": (
        changing(
            wire.State,
            lambda s: s.tick == 12,
            lambda s: {"literals": flipped(s.literals)},
        ),
        r"tick 12: /state coordinator \d+: recorded .*, derived ",
    ),
    "state's depth": (
        changing(wire.State, lambda s: s.tick == 12, lambda s: {"depth": s.depth + 1}),
        r"tick 12: /state ",
    ),
    "reached": (
        changing(
            wire.Reached,
            lambda r: r.tick == 12,
            lambda r: {"literals": flipped(r.literals)},
        ),
        r"tick 12: /reach ",
    ),
    "question": (
        changing(
            wire.WaveStart,
            lambda w: w.tick == 12 and w.kind == "signal",
            lambda w: {"signal": (w.signal[0] ^ 1,)},
        ),
        r"tick 12: /wave ",
    ),
    "action": (
        changing(
            wire.Decision, lambda d: d.tick == 12, lambda d: {"action": d.action + 1}
        ),
        r"tick 12: /decide ",
    ),
    "reason": (
        changing(wire.Decision, lambda d: d.tick == 12, lambda _: {"why": "so"}),
        r"tick 12: /decide ",
    ),
    "keyframe": (
        changing(
            wire.KeyFrame,
            lambda k: k.tick == 14,
            lambda k: {"snapshot": flipped(k.snapshot, 8 * len(k.snapshot) - 1)},
        ),
        r"tick 14: /keyframe ",
    ),
    "wiring": (change_wiring, r"tick \d+: /wiring "),
    "report": (change_report, r"tick 12: /state "),
    "report's pulses": (
        changing(wire.CellReport, lambda _: True, lambda s: {"pulses": s.pulses + 1}),
        r"tick 1: /state ",
    ),
    "two states": (swap_states, r"tick 12: /state "),
    "order of two states": (swap_places, r"tick 1[23]: /state "),
}


# Verifying ----------------------------------------------------------------------------


@every_run
def test_a_run_comes_out_the_same(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, _, outcome = runs.of(name, wiring, snapshot)
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.same
    assert verdict.complete
    counts = (verdict.ticks, verdict.states, verdict.decisions)
    assert counts == (TICKS, TICKS, TICKS)
    assert verdict.waves == len(of_type(log, wire.WaveStart)) > TICKS
    assert verdict.wirings == len(of_type(log, wire.Wiring)) > 0
    assert outcome.totals.ticks == TICKS


@pytest.mark.parametrize("wiring", ["hasse", "derived"])
@pytest.mark.parametrize("snapshot", ["empirical", "discounted"])
def test_the_runs_hold_contradictions_and_equivalences(
    runs: Runs, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, _, outcome = runs.of("csv", wiring, snapshot)
    assert outcome.totals.incoherent > 0
    recording = Recording.open(log)
    graphs = [snapshot_at(recording, tick)[1].poc_graph() for tick in range(12, 19)]
    equivalent = any(len(members) > 1 for g in graphs for members in g.classes())
    # A discounted weight never is 0, which is what an equivalence takes.
    assert equivalent == (snapshot == "empirical")
    dropped = [w for w in of_type(log, wire.Wiring) if w.drop or w.drop_complement]
    assert dropped


@pytest.mark.parametrize("change", TAMPERED)
@pytest.mark.parametrize(("name", "wiring"), [("path", "hasse"), ("csv", "derived")])
def test_a_changed_message_is_found_and_named(
    runs: Runs, tmp_path: Path, name: str, wiring: WiringKind, change: str
) -> None:
    tamper, where = TAMPERED[change]
    verdict = verify(rewritten(runs.of(name, wiring).log, tmp_path / "log", tamper))
    assert not verdict.same
    assert verdict.complete  # every message is there; one of them lies
    assert verdict.difference is not None
    with pytest.raises(AssertionError, match=f"^{where}"):
        raise AssertionError(verdict.difference)


def test_rewriting_alone_changes_nothing(runs: Runs, tmp_path: Path) -> None:
    verdict = verify(rewritten(runs.of("csv").log, tmp_path / "log", lambda r: r))
    assert verdict.same
    assert verdict.complete


def dropped_from(log: Path, target: Path, kind: type[wire.Message]) -> Verdict:
    """Verify a recording without the first message of one kind after tick 11."""

    def change(recorded: list[Recorded]) -> list[Recorded]:
        start, _ = first(recorded, wire.State, lambda s: s.tick == 11)
        later = itertools.islice(recorded, start, None)
        gone = next(r for r in later if isinstance(r.message, kind))
        return [each for each in recorded if each is not gone]

    return verify(rewritten(log, target, change))


@pytest.mark.parametrize("kind", [wire.State, wire.Reached, wire.WaveStart])
def test_a_lost_word_of_the_coordinator_makes_a_difference(
    runs: Runs, tmp_path: Path, kind: type[wire.Message]
) -> None:
    verdict = dropped_from(runs.of("path").log, tmp_path / "log", kind)
    assert not verdict.complete
    assert not verdict.same
    assert verdict.difference is not None
    assert verdict.difference.startswith("tick 1")


@pytest.mark.parametrize(
    ("kind", "ticks"),
    [(wire.Observation, 11), (wire.CellReport, 11), (wire.Pulse, TICKS)],
)
def test_what_cannot_be_derived_for_a_loss_is_incomplete_and_not_different(
    runs: Runs, tmp_path: Path, kind: type[wire.Message], ticks: int
) -> None:
    verdict = dropped_from(runs.of("path").log, tmp_path / "log", kind)
    assert verdict.difference is None
    assert not verdict.complete
    (first, last), *behind = verdict.ranges
    assert (first, last) in ((1, ticks), (1, ticks - 1))
    # From the next key-frame on there is all it takes.
    assert [stop for _, stop in behind] == ([TICKS] if ticks < TICKS else [])


def test_a_report_taken_out_with_its_number_is_found(
    runs: Runs, tmp_path: Path
) -> None:
    recording = Recording.open(runs.of("path").log)
    recorded = close_up(list(recording.messages()))
    expected: dict[str, int] = {}
    for each in recorded:
        expected[each.message.sender] = each.sequence + 1
    verdict = verify(
        write_again(recording, tmp_path / "log", recorded, expected=expected)
    )
    assert verdict.complete
    assert verdict.difference is not None
    assert verdict.difference.startswith("tick 12: /state ")
    assert verdict.difference.endswith("derived nothing")


# From a key-frame on ------------------------------------------------------------------


@every_run
def test_a_run_can_be_derived_from_any_key_frame(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, _, _ = runs.of(name, wiring, snapshot)
    for tick, start in ((7, 7), (13, 7), (14, 14), (27, 21), (28, 28), (99, TICKS)):
        verdict = verify(log, tick)
        assert (verdict.difference, verdict.complete) == (None, True)
        assert (verdict.start, verdict.ticks) == (start, TICKS - start)
    # Before the first there is nothing to begin with but the run.
    assert (verify(log, 6).start, verify(log, 6).ticks) == (0, TICKS)


@pytest.mark.parametrize("change", TAMPERED)
def test_what_is_changed_before_is_not_seen_and_after_it_is(
    runs: Runs, tmp_path: Path, change: str
) -> None:
    tamper, where = TAMPERED[change]
    log = rewritten(runs.of("path").log, tmp_path / "log", tamper)
    differences = {tick: verify(log, tick).difference for tick in (7, 14, 21)}
    early = change in ("report's pulses", "wiring")  # of tick 1, and of the first
    if change == "keyframe":  # that of tick 14: its last bit says nothing
        assert differences[7] is not None
    elif early:
        assert differences[21] is None
    else:
        assert differences[7] is not None
        with pytest.raises(AssertionError, match=f"^{where}"):
            raise AssertionError(differences[7])
        assert differences[14] is differences[21] is None


def test_a_key_frame_that_lies_is_found_by_what_follows(
    runs: Runs, tmp_path: Path
) -> None:
    for number, changes in enumerate(
        (
            lambda k: {"waves": k.waves + 1},
            lambda k: {"epochs": (k.epochs[0] + 1,)},
            lambda k: {"action": 1 - k.action},
            lambda k: {"why": "so"},
        )
    ):
        tamper = changing(wire.KeyFrame, lambda k: k.tick == 14, changes)
        log = rewritten(runs.of("path").log, tmp_path / f"{number}", tamper)
        for tick in (7, 14):  # as it is derived, and as it is believed
            difference = verify(log, tick).difference
            assert difference is not None
            assert difference.startswith(("tick 14: ", "tick 15: "))
        assert verify(log, 21).same


# Senders that overtake each other -----------------------------------------------------


def by_sender(recorded: Iterable[Recorded]) -> dict[str, list[Recorded]]:
    queues: dict[str, list[Recorded]] = {}
    for each in recorded:
        queues.setdefault(each.message.sender, []).append(each)
    return queues


def shuffled(seed: int) -> Change:
    """Return the change that keeps only each sender's own order."""

    def change(recorded: list[Recorded]) -> Iterable[Recorded]:
        queues = [iter(queue) for queue in by_sender(recorded).values()]
        chance = random.Random(seed)
        while queues:
            queue = chance.choice(queues)
            following = next(queue, None)
            if following is None:
                queues.remove(queue)
            else:
                yield following

    return change


def one_after_the_other(last: str) -> Change:
    """Return the change that lets one sender's messages come after all others."""

    def change(recorded: list[Recorded]) -> Iterable[Recorded]:
        queues = by_sender(recorded)
        late = [queues.pop(who) for who in list(queues) if who.startswith(last)]
        return itertools.chain(*queues.values(), *late)

    return change


OVERTAKING = {
    "seed 0": shuffled(0),
    "seed 1": shuffled(1),
    "late reports": one_after_the_other("cell/"),
    "late observations": one_after_the_other("world"),
    "late coordinator": one_after_the_other("coordinator"),
}


@pytest.mark.parametrize("order", OVERTAKING)
@pytest.mark.parametrize("name", ["path", "csv"])
def test_senders_may_overtake_each_other(
    runs: Runs, tmp_path: Path, name: str, order: str
) -> None:
    log = rewritten(runs.of(name).log, tmp_path / "log", OVERTAKING[order])
    for tick in (0, 14):
        verdict = verify(log, tick)
        assert verdict.difference is None
        assert verdict.complete
        assert verdict.ticks == TICKS - tick


# Runs that did not go smoothly --------------------------------------------------------


Lost: TypeAlias = Callable[[int, wire.Message], bool]


def lost_once(which: Lost) -> Lost:
    """Return what is true of the first message only of which `which` is."""
    left = [True]

    def lost(cell: int, message: wire.Message) -> bool:
        if left and which(cell, message):
            left.clear()
            return True
        return False

    return lost


class Simulation:
    """A coordinator, its world and its cells on a hub that needs no loop, recorded.

    Whatever `lost` says of a message on its way to a cell, the recorder hears it; a
    wave that is stuck for it is declared late.
    """

    def __init__(
        self, options: RunOptions, log: Path, seed: int, lost: Lost = lambda *_: False
    ) -> None:
        self.core = Coordinator.of(options)
        self._hub = MemoryHub(seed)
        self._rows = readings()
        self._lost = lost
        self._log_time = 0
        self._observed = 0
        self._writer = Writer(log, chunk=2000)
        self._writer.start({**describe(options), "swarm": "simulated"})
        self._ends: dict[str, MemoryFabric] = {}
        self._recorder = self._hub.fabric("recorder")
        self._recorder.listen(("**",), self._record)
        self._conducting = self._join("coordinator")
        self._conducting.listen(("observe", "settle/**"), self._conduct)
        self._world = self._join("world")
        self._world.listen(("decide",), self._observe)
        for number in range(len(options.sensors)):
            self._join_cell(number)

    def _join(self, who: str) -> MemoryFabric:
        self._ends[who] = self._hub.fabric(who)
        return self._ends[who]

    def _join_cell(self, number: int) -> None:
        core, end = Cell(number), self._join(f"cell/{number}")

        def handle(deliveries: list[wire.Delivery]) -> None:
            burst = [wire.decode(d.key, d.payload) for d in deliveries]
            kept = [message for message in burst if not self._lost(number, message)]
            for message in core.receive(kept):
                end.publish(message)

        end.listen(wire.cell_keys(number), handle)

    def _record(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            self._log_time += 1
            self._writer.add(delivery, self._log_time)

    def _conduct(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            self.say(self.core.receive(wire.decode(delivery.key, delivery.payload)))

    def _observe(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            message = wire.decode(delivery.key, delivery.payload)
            assert isinstance(message, wire.Decision)
            bits = self._rows[message.tick]
            self._observed = message.tick + 1
            self._world.publish(wire.Observation(self._observed, pack(bits)))

    def say(self, messages: Iterable[wire.Message]) -> None:
        for message in messages:
            self._conducting.publish(message)

    def run(self, stop: Callable[["Simulation"], bool] = lambda _: False) -> None:
        """Go on until the run is over, asked to stop as soon as `stop` is true."""
        self.say(self.core.begin())
        asked = False
        while self._hub.pending or not self.core.finished:
            if not self._hub.step():
                stuck = self.core.in_flight
                assert stuck, "nothing is under way, and nothing is late"
                self.say(self.core.overdue(stuck[0]))
            if not asked and stop(self):
                asked = True
                self.say(self.core.stop())
        for who, end in self._ends.items():
            end.publish(wire.Leave(who))
        self._hub.run()
        self._writer.finish({}, {who: end.sent for who, end in self._ends.items()})


LOST: dict[str, Lost] = {
    "pulse": lambda _, m: isinstance(m, wire.Pulse) and m.wave > 20,
    "start": lambda _, m: isinstance(m, wire.WaveStart) and m.wave > 20,
    "observation": lambda _, m: isinstance(m, wire.Observation) and m.tick > 9,
    "wiring": lambda _, m: isinstance(m, wire.Wiring) and m.after > 1,
}


@pytest.mark.parametrize("wiring", ["hasse", "derived"])
@pytest.mark.parametrize("what", LOST)
@pytest.mark.parametrize("seed", range(3))
def test_a_run_with_a_repeated_wave_comes_out_the_same(
    runs: Runs, tmp_path: Path, what: str, wiring: WiringKind, seed: int
) -> None:
    log = tmp_path / "log"
    options = options_for(runs.csv, wiring)
    Simulation(options, log, seed, lost_once(LOST[what])).run()
    repeated = [start for start in of_type(log, wire.WaveStart) if start.repeats]
    assert repeated
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == TICKS
    # And it is the run that would have been without the loss.
    assert course(log) == course(runs.of("csv", wiring).log)


@pytest.mark.parametrize("seed", range(3))
def test_a_cell_that_has_the_wrong_edges_is_found(
    runs: Runs, tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that was told of them and says so, and forgot some all the same."""
    log = tmp_path / "log"
    forgets = lost_once(lambda _, m: isinstance(m, wire.Wiring) and bool(m.add))
    rewire = Cell._rewire

    def forgetful(cell: Cell, wiring: wire.Wiring, *rest: Any) -> None:
        if wiring.after > 1 and forgets(cell.cell, wiring):
            wiring = msgspec.structs.replace(wiring, add=())
        rewire(cell, wiring, *rest)

    monkeypatch.setattr(Cell, "_rewire", forgetful)
    # A key-frame would have it told again.
    options = msgspec.structs.replace(options_for(runs.csv), keyframe_every=1000)
    Simulation(options, log, seed).run()
    verdict = verify(log)
    assert verdict.complete
    assert verdict.difference is not None
    assert ": cells reported [" in verdict.difference


def test_a_repeat_that_names_another_wave_is_found(runs: Runs, tmp_path: Path) -> None:
    log = tmp_path / "log"
    Simulation(options_for(runs.csv), log, 0, lost_once(LOST["pulse"])).run()
    tamper = changing(
        wire.WaveStart, lambda w: w.repeats > 0, lambda w: {"repeats": w.repeats - 1}
    )
    verdict = verify(rewritten(log, tmp_path / "tampered", tamper))
    assert verdict.difference is not None
    assert "/w" in verdict.difference  # its wave, or the wirings before it


def test_a_stopped_run_comes_out_the_same(runs: Runs, tmp_path: Path) -> None:
    log = tmp_path / "log"
    outcome = recorded_run(runs.of("path").options, log, stop_at=9)
    assert outcome.stopped
    assert 9 <= outcome.totals.ticks < TICKS
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == outcome.totals.ticks
    assert of_type(log, wire.KeyFrame)[-1].tick == outcome.totals.ticks


def test_a_run_ends_in_order_where_its_source_does(runs: Runs, tmp_path: Path) -> None:
    log = tmp_path / "log"
    outcome = recorded_run(options_for(runs.csv, ticks=1000), log)
    assert not outcome.stopped
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == outcome.totals.ticks == len(readings())


STOPS: dict[str, Callable[[Simulation], bool]] = {
    "between two ticks": lambda s: s.core.tick >= 9 and not s.core.in_flight,
    "in the middle of a tick": lambda s: s.core.tick >= 9 and bool(s.core.in_flight),
    "where a key-frame is due": lambda s: s.core.tick == 7,
    "before the first": lambda s: True,
}


@pytest.mark.parametrize("when", STOPS)
@pytest.mark.parametrize("seed", range(3))
def test_a_run_may_stop_anywhere(
    runs: Runs, tmp_path: Path, when: str, seed: int
) -> None:
    log = tmp_path / "log"
    simulation = Simulation(options_for(runs.csv), log, seed)
    simulation.run(STOPS[when])
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == simulation.core.tick < TICKS


# Recordings cut short -----------------------------------------------------------------


def offsets(log: Path, count: int) -> list[int]:
    """Return places to cut at: round every chunk's end, and drawn ones."""
    size = log.stat().st_size
    chunks = Recording.open(log).layout.chunks
    edges = [chunk.offset + step for chunk in chunks for step in (-1, 0, 1)]
    chance = random.Random(3)
    drawn = [chance.randrange(size) for _ in range(count)]
    return sorted({*chance.sample(edges, min(count, len(edges))), *drawn, size - 1})


def cut_at(log: Path, target: Path, size: int) -> Path:
    target.write_bytes(log.read_bytes()[:size])
    return target


def cut_in(log: Path, target: Path, share: float) -> Path:
    """Cut in the middle of the chunk behind a share of them."""
    chunks = Recording.open(log).layout.chunks
    number = int(share * len(chunks))
    return cut_at(log, target, (chunks[number].offset + chunks[number + 1].offset) // 2)


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_a_recording_cut_anywhere_is_incomplete_and_never_different(
    runs: Runs, tmp_path: Path, seed: int | None
) -> None:
    recording = Recording.open(runs.of("csv").log)
    recorded: Iterable[Recorded] = list(recording.messages())
    if seed is not None:
        recorded = shuffled(seed)(list(recorded))
    whole = write_again(recording, tmp_path / "log", recorded, chunk=1500)
    first_chunk = Recording.open(whole).layout.chunks[0].offset
    ticks = set()
    for size in offsets(whole, 30):
        cut = cut_at(whole, tmp_path / "cut", size)
        if size < first_chunk:  # says little or nothing of its run
            with pytest.raises(RecordingError):
                verify(cut)
            continue
        verdict = verify(cut)
        assert verdict.difference is None, f"cut at {size}: {verdict.difference}"
        assert not verdict.complete, f"cut at {size}"
        ticks.add(verdict.ticks)
    assert len(ticks) > (5 if seed is None else 1)


@pytest.mark.parametrize("what", ["pulse", "start"])
def test_a_cut_recording_of_a_repeated_wave_is_never_different(
    runs: Runs, tmp_path: Path, what: str
) -> None:
    log = tmp_path / "log"
    Simulation(options_for(runs.csv), log, 1, lost_once(LOST[what])).run()
    recording = Recording.open(log)
    recorded = list(recording.messages())
    repeat, _ = first(recorded, wire.WaveStart, lambda w: w.repeats > 0)
    for end in range(repeat - 12, repeat + 12):
        cut = tmp_path / f"{end}.mcap"
        with Writer(cut) as writer:  # left without an end
            writer.start(recording.metadata)
            for each in recorded[:end]:
                writer.add(each.delivery, each.log_time)
        verdict = verify(cut)
        assert verdict.difference is None, f"cut after {end}: {verdict.difference}"
        assert not verdict.complete


# Going on -----------------------------------------------------------------------------


def course(log: Path) -> tuple[dict[int, bytes], dict[int, wire.Decision]]:
    """Return the state and the decision of every tick."""
    return (
        {state.tick: state.literals for state in of_type(log, wire.State)},
        {decision.tick: decision for decision in of_type(log, wire.Decision)},
    )


def assert_went_on(log: Path, uninterrupted: Run, resumed: list[int]) -> None:
    """Check that `log` is a true run, and the one that was never interrupted."""
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.complete
    assert verdict.ticks == uninterrupted.options.ticks
    assert course(log) == course(uninterrupted.log)
    recording = Recording.open(log)
    assert msgspec.json.decode(recording.metadata["resumed"]) == resumed
    assert recording.completeness().whole


@every_run
def test_a_finished_run_goes_on_twice(
    runs: Runs,
    tmp_path: Path,
    name: str,
    wiring: WiringKind,
    snapshot: SnapshotKind,
) -> None:
    source = runs.csv if name == "csv" else PATH
    start, once, twice = (tmp_path / part for part in ("start", "once", "twice"))
    recorded_run(options_for(source, wiring, snapshot, ticks=12), start)
    resumed_run(start, once, 21)
    resumed_run(once, twice, TICKS)
    assert_went_on(twice, runs.of(name, wiring, snapshot), [12, 21])


@pytest.mark.parametrize("name", ["path", "csv"])
def test_a_stopped_run_goes_on(runs: Runs, tmp_path: Path, name: str) -> None:
    uninterrupted = runs.of(name)
    stopped, new = tmp_path / "stopped", tmp_path / "new"
    outcome = recorded_run(uninterrupted.options, stopped, stop_at=9)
    resumed_run(stopped, new, TICKS)
    assert_went_on(new, uninterrupted, [outcome.totals.ticks])


@pytest.mark.parametrize("seed", [None, 2])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_cut_run_goes_on_and_is_cut_and_goes_on(
    runs: Runs, tmp_path: Path, seed: int | None, share: float
) -> None:
    uninterrupted = runs.of("csv")
    recording = Recording.open(uninterrupted.log)
    recorded = list(recording.messages())
    if seed is not None:
        recorded = jittered(recorded, seed)
    small = write_again(recording, tmp_path / "small", recorded, chunk=1500)
    cut = cut_in(small, tmp_path / "cut", share)
    tick = verify(cut).ticks
    resumed_run(cut, tmp_path / "once", TICKS)
    assert_went_on(tmp_path / "once", uninterrupted, [tick])

    again = Recording.open(tmp_path / "once")
    small = write_again(again, tmp_path / "again", again.messages(), chunk=1500)
    cut = cut_in(small, tmp_path / "cut again", 0.9)
    following = verify(cut).ticks
    assert tick < following < TICKS
    resumed_run(cut, tmp_path / "twice", TICKS)
    assert_went_on(tmp_path / "twice", uninterrupted, [tick, following])


def jittered(recorded: list[Recorded], seed: int) -> list[Recorded]:
    """Let senders overtake each other by a few messages, as they do on a network."""
    chance = random.Random(seed)
    due: dict[str, float] = {}
    keyed = []
    for place, each in enumerate(recorded):
        who = each.message.sender
        due[who] = max(due.get(who, 0.0), place + chance.random() * 12)
        keyed.append((due[who], place, each))
    return [each for _, _, each in sorted(keyed, key=lambda entry: entry[:2])]


def test_a_run_with_a_repeated_wave_goes_on(runs: Runs, tmp_path: Path) -> None:
    log, new = tmp_path / "log", tmp_path / "new"
    options = options_for(runs.csv, ticks=15)
    Simulation(options, log, 4, lost_once(LOST["pulse"])).run()
    resumed_run(log, new, TICKS)
    assert_went_on(new, runs.of("csv"), [15])


def test_without_a_whole_tick_there_is_nothing_to_go_on_from(
    runs: Runs, tmp_path: Path
) -> None:
    recording = Recording.open(runs.of("csv").log)
    recorded = list(recording.messages())
    state, _ = first(recorded, wire.State, lambda _: True)
    log = write_again(recording, tmp_path / "log", recorded[:state], expected={})
    with pytest.raises(RecordingError, match=r"must hold a whole tick .*, got none$"):
        find_resume_point(log)


def test_a_tampered_run_is_not_gone_on_with(runs: Runs, tmp_path: Path) -> None:
    """What counts is what follows the last key-frame but one, that of tick 28."""
    tamper = changing(
        wire.State,
        lambda s: s.tick == 29,
        lambda s: {"literals": flipped(s.literals)},
    )
    log = rewritten(runs.of("csv").log, tmp_path / "log", tamper)
    with pytest.raises(RecordingError, match=r"must be a true run: tick 29: /state"):
        find_resume_point(log)


def test_a_run_that_lacks_a_pulse_is_not_gone_on_with(
    runs: Runs, tmp_path: Path
) -> None:
    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, _ = first(recorded, wire.Pulse, lambda _: True)
        return recorded[:place] + recorded[place + 1 :]

    log = rewritten(runs.of("csv").log, tmp_path / "log", change)
    rule = rf"must be whole up to tick {TICKS}, lacks \{{'cell/\d': 1\}}$"
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(log)


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with Writer(log) as writer:
        writer.start({"world": "none"})
        writer.finish({}, {})
    rule = r"log: options: must be those of a run, got 'options'$"
    with pytest.raises(RecordingError, match=rule):
        verify(log)
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(log)


# Seeking ------------------------------------------------------------------------------


def learned(snapshot: Snapshot) -> dict[str, object]:
    """Return all of a snapshot but its state, comparable."""
    arrays = {n: a.tolist() for n, a in snapshot.arrays().items() if n != "state"}
    return {"kind": type(snapshot).__name__, **arrays}


@pytest.mark.parametrize("name", ["path", "csv"])
@pytest.mark.parametrize("snapshot", ["empirical", "discounted"])
def test_a_snapshot_at_a_tick_is_one_that_learned_that_far(
    runs: Runs, name: str, snapshot: SnapshotKind
) -> None:
    log, options, _ = runs.of(name, "hasse", snapshot)
    recording = Recording.open(log)
    assert last_tick(recording) == TICKS
    frames = [frame.tick for frame in of_type(log, wire.KeyFrame)]
    assert frames == [7, 14, 21, 28, TICKS]
    reference = options.new_snapshot()
    assert learned(snapshot_at(recording, 0)[1]) == learned(reference)
    for observation in of_type(log, wire.Observation):
        reference.learn(unpack(observation.bits, len(options.sensors)))
        tick, found = snapshot_at(recording, observation.tick)
        assert tick == observation.tick == found.clock
        assert learned(found) == learned(reference)
        assert np.array_equal(found.poc_graph().edges, reference.poc_graph().edges)
    assert learned(snapshot_at(recording)[1]) == learned(reference)


@pytest.mark.parametrize("tick", [-1, TICKS + 1])
def test_a_tick_that_is_not_there_is_refused(runs: Runs, tick: int) -> None:
    recording = Recording.open(runs.of("csv").log)
    rule = rf"^tick: must be in \[0, {TICKS}\], got {tick}$"
    with pytest.raises(InvalidValueError, match=rule):
        snapshot_at(recording, tick)


def test_a_lost_observation_is_named_unless_a_key_frame_covers_it(
    runs: Runs, tmp_path: Path
) -> None:
    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, _ = first(recorded, wire.Observation, lambda o: o.tick == 9)
        return recorded[:place] + recorded[place + 1 :]

    recording = Recording.open(rewritten(runs.of("csv").log, tmp_path / "log", change))
    with pytest.raises(RecordingError, match=r"observation of tick 9, got none$"):
        snapshot_at(recording, 13)
    assert snapshot_at(recording, 14)[1].clock == 14


# Depth --------------------------------------------------------------------------------


@every_run
def test_a_recording_gives_a_row_for_every_wave(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, options, outcome = runs.of(name, wiring, snapshot)
    rows = from_recording(Recording.open(log))
    results: list[wire.State | wire.Reached] = [
        *of_type(log, wire.State),
        *of_type(log, wire.Reached),
    ]
    results.sort(key=lambda result: result.wave)
    assert [(r.depth, r.height, r.longest, r.pulses) for r in rows] == [
        (r.depth, r.height, r.longest, r.pulses) for r in results
    ]
    assert [row.kind for row in rows] == [
        "state" if isinstance(result, wire.State) else "signal" for result in results
    ]
    assert {(row.sensors, row.wiring) for row in rows} == {
        (len(options.sensors), wiring)
    }
    assert all(row.seconds > 0 for row in rows)
    assert sum(row.seconds for row in rows) < outcome.seconds
    assert max(row.depth for row in rows) == outcome.totals.depth > 0
    # To a representative, along an edge, to a member: however high the order is.
    most = 3 if wiring == "derived" else TICKS
    assert all(row.depth <= min(most, row.height + 2) for row in rows)


def test_a_wave_whose_start_was_lost_is_named(runs: Runs, tmp_path: Path) -> None:
    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, _ = first(recorded, wire.WaveStart, lambda w: w.wave == 7)
        return recorded[:place] + recorded[place + 1 :]

    recording = Recording.open(rewritten(runs.of("csv").log, tmp_path / "log", change))
    with pytest.raises(RecordingError, match=r"wave 7: must have its start, got none$"):
        from_recording(recording)
