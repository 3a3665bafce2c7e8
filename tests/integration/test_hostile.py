"""A run is unaffected by a foreign client on its network.

The stranger is connected to the hub, hears everything, and sends under every key what
is no message, what is far too large, what it has heard before, and what no part could
have sent. What it cannot be stopped from, here, is to say just what a part would say
next: an observation of the next tick, a decision of this one, a pulse or a report with
credit of a wave in flight, the start of the next wave, a cell's next wiring, a last
word, a part's presence. Only a list of who may put what can rule that out.
"""

import asyncio
import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime import inline_tasks, launch
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run_with_restarts import run
from neurosnap.sensorium import pack
from tests.support.patience import PATIENCE

pytestmark = pytest.mark.slow
SENSORS = 4
CELLS = [f"cell/{cell}" for cell in range(SENSORS)]
LARGEST = 2**31 - 1
LARGE = 3_000_000  # bytes
BEGIN = 20  # ticks before it speaks up
ROWS = 10_000  # more than go by meanwhile

KEYS: dict[str, list[str]] = {
    # Nobody in these runs acts on most of them; the recorder reports what is foreign.
    **{topic: [] for topic in wire.TOPICS},
    "observation": ["coordinator", *CELLS],
    "wiring/1": ["cell/1"],
    "wavestart": CELLS,
    "wavestart/2": ["cell/2"],
    "pulse/0/cell/1": ["cell/0"],
    "pulse/3/cell/1": ["cell/3"],
    "recall": CELLS,
    "recall/2": ["cell/2"],
    "reminder/cell/2": ["cell/2"],
    **{
        topic: ["coordinator"]
        for topic in (
            "cellreport",
            "workerreport",
            "recalled",
            "learned",
            "fault",
            "leave",
        )
    },
    "recalled/cell/1": ["coordinator"],
    "cellreport/cell/1": ["coordinator"],
    "workerreport/worker/0": ["coordinator"],
    "fault/cell/1": ["coordinator"],
    "leave/cell/1": ["coordinator"],
    "decision": ["world"],
}
"""Every topic, for cells a key of one of them, and who reads it and so must report."""

GARBAGE = [
    b"",
    b"\xff\xfe\x00",
    b"null",
    b"[" * 100_000,
    b'{"unknown":' + b"[" * 100_000,
    b'{"type":"nonsense"}',
    b'{"type":"leave","who":7}',
    b'{"type":"leave","who":"\\ud800"}',
    b'{"type":"pulse","wave":1e999,"source":NaN}',
    b'{"type":"cellreport","wave":' + b"9" * 10_000 + b"}",
    wire.encode(wire.Wiring(SENSORS + 5, 1, 0)),  # a message, but of another key
]
OVERSIZED = [
    b'{"type":"' + b"x" * LARGE + b'"}',
    b'{"type":"observation","tick":0,"bits":"' + b"A" * LARGE + b'"}',
    b'{"type":"wavestart","signal":[' + b"-1," * (LARGE // 3) + b"0]}",
]


def start(cell: int = -1, **changes: int) -> wire.WaveStart:
    honest = wire.WaveStart(1, 1, "state", 0, 1, fence=0, cell=cell)
    return msgspec.structs.replace(honest, **changes)


OUT_OF_RANGE: list[tuple[wire.Message, list[str]]] = [
    (wire.Observation(LARGEST, pack([True] * SENSORS)), ["coordinator", *CELLS]),
    (wire.Observation(1, bytes(1000)), ["coordinator", *CELLS]),
    (wire.Observation(1, bytes(LARGE)), ["coordinator", *CELLS]),
    (wire.Observation(1, b""), ["coordinator", *CELLS]),
    (wire.Wiring(1, LARGEST, 0), ["cell/1"]),
    (wire.Wiring(1, LARGEST, LARGEST - 1, add=(LARGEST,)), ["cell/1"]),
    (start(wave=LARGEST), CELLS),
    (start(fence=LARGEST), CELLS),
    (start(settled_below=LARGEST), CELLS),
    (start(tick=LARGEST), CELLS),
    (start(credit=LARGEST), CELLS),
    (start(2, wave=LARGEST, settled_below=LARGEST), ["cell/2"]),
    (start(2, tick=LARGEST), ["cell/2"]),
    (wire.Pulse(LARGEST, 2, 0, 1, 1), ["cell/0"]),
    (wire.Pulse(1, 2, 0, LARGEST, 1), ["cell/0"]),
    (wire.Pulse(1, 2, 7, 1, LARGEST), ["cell/3"]),
    (wire.Pulse(1, 2, 7, 1, 1, LARGEST), ["cell/3"]),
    (wire.CellReport(1, LARGEST, 0, (), (), (0,), 0), ["coordinator"]),
    (wire.CellReport(LARGEST, 1, 0, (), (), (1,), 0), ["coordinator"]),
    (wire.Leave("nobody"), ["coordinator"]),
    (wire.Decision(LARGEST, LARGEST, ""), ["world"]),
    (wire.State(LARGEST, 1, b"", True, 0, 0, 0, 0, 0), []),
    (wire.Reached(LARGEST, 1, (LARGEST,), b"", 0, 0, 0, 0), []),
    (wire.KeyFrame(LARGEST, b"no snapshot"), []),
]


class Stranger:
    """Hears everything; sends what it should not; knows what should come of it."""

    def __init__(self) -> None:
        self.expected: Counter[str] = Counter()
        self.foreign = 0
        self.replayed = 0
        self._heard: list[wire.Delivery] = []
        self._faults: Counter[str] = Counter()
        self._begun = asyncio.Event()
        self._answered = asyncio.Event()
        self._sent = False

    def handle(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            if not self._begun.is_set():
                self._heard.append(delivery)
            if delivery.key == "state" and not self._begun.is_set():
                state = wire.decode(delivery.key, delivery.payload)
                assert isinstance(state, wire.State)
                if state.tick >= BEGIN:
                    self._begun.set()
            if wire.topic(delivery.key) == "fault" and self._begun.is_set():
                self._take(delivery)
        if self._sent and self._faults >= self.expected:
            self._answered.set()

    def _take(self, delivery: wire.Delivery) -> None:
        try:
            fault = msgspec.json.decode(delivery.payload, type=wire.Fault)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            return  # its own
        self._faults[fault.who] += 1

    async def attack(self, send: Callable[[wire.Delivery], None]) -> None:
        """Send everything, wait until all of it was reported."""
        await self._begun.wait()
        for key, readers in KEYS.items():
            for payload in (*GARBAGE, *OVERSIZED):
                send(wire.Delivery(key, LARGEST, 0, payload))
                self.foreign += 1
                self.expected.update([*readers, "recorder"])
            await asyncio.sleep(0)  # a few ticks go by
        for message, readers in OUT_OF_RANGE:
            # A number that was there before: the recording keeps the honest message.
            send(wire.Delivery(message.key, 0, 0, wire.encode(message)))
            self.expected.update(readers)
            # A report and a last word are said to be of parts that the run has not.
            if message.sender in (f"cell/{LARGEST}", "nobody"):
                self.foreign += 1
                self.expected["recorder"] += 1
            await asyncio.sleep(0)
        for delivery in self._heard:
            send(delivery)
            self.replayed += 1
            self.expected["coordinator"] += delivery.key == "observation"
            if self.replayed % 20 == 0:
                await asyncio.sleep(0)
        self._sent = True
        await self._answered.wait()


def options_for(folder: Path, cells: CellKind, ticks: int) -> RunOptions:
    """Return a run of readings in which s0 implies s1 but for now and then."""
    names = tuple(f"s{sensor}" for sensor in range(SENSORS))
    source = folder / "readings.csv"
    if not source.exists():
        chance = random.Random(5)
        rows = [",".join(names)]
        for _ in range(ROWS):
            bits = [chance.random() < 0.5 for _ in names]
            bits[1] |= bits[0] and chance.random() < 0.99
            rows.append(",".join(str(int(bit)) for bit in bits))
        source.write_text("\n".join(rows) + "\n")
    return RunOptions(
        source=str(source),
        body=Body(own=names, actions=()),
        ticks=ticks,
        threshold=0.1,
        cells=cells,
        workers=2 if cells == "worker" else 0,
    )


Outcomes = tuple[list[tuple[int, bytes, bool]], list[wire.Decision], list[bytes]]


def outcomes(recording: Recording) -> Outcomes:
    """Return the states, the decisions between them, and the wirings as bytes."""
    messages = [r.message for r in recording.messages(("state", "decision"))]
    states = [
        (m.tick, m.literals, m.incoherent)
        for m in messages
        if isinstance(m, wire.State)
    ]
    # Whether the last tick's decision is said depends on when the run was stopped.
    decisions = [
        m for m in messages if isinstance(m, wire.Decision) and m.tick < len(states)
    ]
    return states, decisions, [r.payload for r in recording.messages(("wiring",))]


async def check(
    stranger: Stranger,
    disturb: Callable[[Stranger, RunOptions, Path, asyncio.Event], asyncio.Task[None]],
    cells: CellKind,
    tmp_path: Path,
) -> None:
    """Run with the stranger until all was reported; then without, as far."""
    stop, log = asyncio.Event(), tmp_path / "disturbed.mcap"
    options = options_for(tmp_path, cells, ROWS)
    async with asyncio.timeout(PATIENCE):
        attack = disturb(stranger, options, log, stop)
        outcome = await run(RunRequest(options, log), stop)
        await attack
    disturbed = Recording.open(log)
    states, decisions, wirings = outcomes(disturbed)

    faults = [r.message for r in disturbed.messages(("fault",))]
    said = Counter(f.who for f in faults if isinstance(f, wire.Fault))
    assert said == stranger.expected
    assert outcome.totals.faults == sum(stranger.expected.values())
    assert outcome.completeness is not None
    assert not outcome.completeness.missing
    assert outcome.completeness.gaps  # who speaks as another under its numbers is named
    assert outcome.completeness.foreign == stranger.foreign
    again = stranger.replayed + len(OUT_OF_RANGE) - 2
    assert outcome.completeness.duplicates == again
    assert all(len(r.payload) < 1000 for r in disturbed.messages(("fault",)))

    clean_log = tmp_path / "undisturbed.mcap"
    calm = options_for(tmp_path, "inline", len(states))
    await run(RunRequest(calm, clean_log), asyncio.Event())
    assert outcomes(Recording.open(clean_log)) == (states, decisions, wirings)
    assert len(states) > BEGIN


async def test_in_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hubs: list[MemoryHub] = []
    made = asyncio.Event()

    class Tapped(MemoryHub):
        def __init__(self) -> None:
            super().__init__()
            hubs.append(self)
            made.set()

    monkeypatch.setattr(inline_tasks, "MemoryHub", Tapped)

    def disturb(
        stranger: Stranger, options: RunOptions, log: Path, stop: asyncio.Event
    ) -> asyncio.Task[None]:
        async def attack() -> None:
            await made.wait()
            hubs[0].fabric("stranger").listen(("**",), stranger.handle)
            await stranger.attack(lambda d: hubs[0].send("stranger", d))
            stop.set()

        return asyncio.create_task(attack())

    await check(Stranger(), disturb, "inline", tmp_path)


@pytest.mark.zenoh
@pytest.mark.exhaustive
async def test_in_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: asyncio.Future[tuple[str, str]] = asyncio.get_running_loop().create_future()

    class Tapped(launch._Launch):
        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)  # type: ignore[arg-type]
            if not found.done():
                found.set_result((self.swarm, self._connections._own))

    monkeypatch.setattr(launch, "_Launch", Tapped)

    def disturb(
        stranger: Stranger, options: RunOptions, log: Path, stop: asyncio.Event
    ) -> asyncio.Task[None]:
        async def attack() -> None:
            swarm, endpoint = await found
            async with ZenohFabric("stranger", swarm, HubAddress(endpoint)) as fabric:
                await fabric.subscribe(("**",), stranger.handle)
                for key in KEYS:  # with no number beside it, nobody even looks
                    fabric._session.put(f"{wire.ROOT}/{swarm}/{key}", b"\xff")
                await stranger.attack(fabric.forward)
            stop.set()

        return asyncio.create_task(attack())

    await check(Stranger(), disturb, "process", tmp_path)
