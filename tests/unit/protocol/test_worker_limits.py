"""A worker refuses invalid and oversized messages."""

import msgspec
import pytest

from neurosnap import wire
from neurosnap.protocol.wave_settling import DEEPEST
from tests.support.wave_messages import packed, start, state_wave
from tests.support.worker_messages import (
    ME,
    SENSORS,
    batch,
    edges,
    fired_by,
    fired_in,
    observation,
    wired,
)


def changed(**fields: object) -> wire.PulseBatch:
    return msgspec.structs.replace(batch((0, 6, 1, 1)), **fields)


WRONG: list[tuple[wire.Message, str]] = [
    (wire.Pulse(1, 0, 6, 1, 0), "pulse: is not for a worker"),
    (wire.WorkerWiring(0, 2, 1), "workerwiring: must be for this worker, got 0"),
    (wire.WorkerWiring(ME, 4098, 0), "workerwiring: epoch must be at most 4096 bey"),
    (wire.WorkerWiring(ME, 2, 1, packed(6)), "workerwiring: add: must be eight byt"),
    (wire.WorkerWiring(ME, 2, 1, b"", packed(4, 6)), "workerwiring: drop must lead f"),
    (wire.WorkerWiring(ME, 2, 1, packed(6, 18)), "workerwiring: add must lead to 0 to"),
    (wire.WorkerWiring(ME, 2, 1, packed(6, -1)), "workerwiring: add must lead to 0"),
    (wire.WorkerWiring(ME, 2, 1, packed(6, 8, 6, 8)), "workerwiring: add must be asc"),
    (wire.WaveStart(2, 0, "signal", 0, 1, (6,), cell=3), "wavestart: must be for all"),
    (start(2, 6, credit=DEEPEST + 1), "wavestart: must have credit up to"),
    (start(2, 6, below=3), "wavestart: must settle only what is before wave 2, got"),
    (start(10_000, 6), "wavestart: wave must be at most 4096 beyond 1, got 10000"),
    (state_wave(2, 50, credit=4), "wavestart: tick must be at most 8 ticks after 1"),
    (observation(50), "observation: tick must be at most 8 ticks after 1, got 50"),
    (wire.Observation(2, b"\0"), "observation: must hold 2 bytes, got 1"),
    (wire.Observation(2, b"\1\0", known=b"\2\0"), "observation: must be 0 where it"),
    (changed(to=2), "pulsebatch: must be for this worker, got 2"),
    (batch((6, 6, 1, 1), worker=1), "pulsebatch: must be another worker's, got 1"),
    (batch((0, 6, 1, 1), worker=3), "pulsebatch: must be another worker's, got 3"),
    (batch((12, 6, 1, 1)), "pulsebatch: sources must be 0 to 5, got 12 to 12"),
    (batch((0, 6, 1, 1), (0, 12, 1, 1)), "pulsebatch: targets must be 6 to 11, got"),
    (batch((0, 6, 0, 1)), "pulsebatch: hops must be 1 to"),
    (batch((0, 6, DEEPEST + 1, 1)), "pulsebatch: hops must be 1 to"),
    (batch((0, 6, 1, -1)), "pulsebatch: credit must be 0 to"),
    (batch((0, 6, 1, DEEPEST + 1)), "pulsebatch: credit must be 0 to"),
    (batch((0, 6, 1, 1), wave=10_000), "pulsebatch: wave must be at most 4096 beyond"),
    (changed(hops=packed(1, 1)), "pulsebatch: must be whole pulses, got [1, 2]"),
    (wire.PulseBatch(1, 0, ME, 0, b"", b"", b"", b""), "pulsebatch: must be whole pul"),
    (changed(hops=b"\1"), "pulsebatch: hops: must be four bytes a number, got 1"),
]


@pytest.mark.parametrize(("message", "what"), WRONG, ids=[what for _, what in WRONG])
def test_what_cannot_be_right_is_a_fault_and_changes_nothing(
    message: wire.Message, what: str
) -> None:
    workers = [wired((6, 8), (8, 0)), wired((6, 8), (8, 0))]
    before: list[wire.Message] = [observation(1, 3), state_wave(1, 1, credit=4)]
    after: list[wire.Message] = [
        batch((0, 10, 1, 1)),
        start(2, 6),
        observation(2),
        state_wave(3, 2, credit=4),
        wire.WorkerWiring(ME, 2, 1, edges([(6, 10)])),
        start(4, 6),
    ]
    for worker in workers:
        worker.receive(before)
    (fault,) = workers[0].receive([message])
    assert isinstance(fault, wire.Fault)
    assert fault.what.startswith(what)
    assert workers[0].receive(after) == workers[1].receive(after)


def test_more_pulses_than_may_wait_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("neurosnap.protocol.worker._HELD", 3)
    worker = wired()
    held = batch((0, 6, 1, 1), (0, 8, 1, 1))
    assert worker.receive([held]) == []
    more = batch((0, 6, 1, 1), (0, 8, 1, 1), wave=2)
    (fault,) = worker.receive([more])
    assert fault == wire.Fault(
        "worker/1", "pulsebatch: must leave up to 3 pulses waiting"
    )
    assert fired_by(worker, start())
    # Those wait no more, and those of a wave that is forgotten do not either.
    assert worker.receive([more]) == []
    assert fired_by(worker, start(3, 6, below=3))
    assert worker.receive([batch((0, 6, 1, 1), (0, 8, 1, 1), wave=4)]) == []


def test_more_batches_than_are_remembered_are_refused_until_waves_settle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.protocol.cell_and_worker_base.REMEMBERED", 2)
    worker = wired()
    worker.receive([start(1, 6)])
    for part in (0, 1):
        worker.receive([batch((0, 8, 1, 1), part=part)])
    said = worker.receive([batch((0, 8, 1, 1), part=2)])
    what = "pulsebatch: must be one of 2 in flight, got one more"
    assert said == [wire.Fault("worker/1", what)]
    worker.receive([start(2, 6, below=2)])
    assert fired_by(worker, batch((0, 8, 1, 1), wave=2))


def test_more_waves_than_may_be_in_flight_are_refused_until_some_settle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.protocol.cell_and_worker_base.WAVES", 3)
    worker = wired()
    waiting = [batch((0, 8, 1, 1), wave=wave) for wave in (2, 3, 4, 5)]
    (fault,) = worker.receive(waiting)
    what = "pulsebatch: must be of 3 waves in all, got wave 5 too"
    assert fault == wire.Fault("worker/1", what)
    (fault,) = worker.receive([start(1, 6)])
    what = "wavestart: must be of 3 waves in all, got wave 1 too"
    assert fault == wire.Fault("worker/1", what)
    # What a wave settles makes room for it.
    assert fired_by(worker, start(5, 6, below=3))
    assert set(worker._waves) == {3, 4, 5}


def test_of_a_signal_only_its_own_literals_are_kept_each_once() -> None:
    worker = wired()
    worker.receive([wire.WorkerWiring(ME, 3, 2)])  # a change was lost: the waves wait
    signal = tuple(range(2 * SENSORS)) * 1000
    worker.receive([start(1, *signal), state_wave(2, 1, *signal, credit=4)])
    kept = [wave.start for wave in worker._waves.values()]
    assert [one and one.signal for one in kept] == [tuple(range(6, 12))] * 2
    out = worker.receive([wire.WorkerWiring(ME, 4, 0)])
    found = [fired_in(m) for m in out if isinstance(m, wire.WorkerReport)]
    assert found == [dict.fromkeys(range(6, 12), 0)] * 2
