"""A recorded run derived again is told from one in which something was changed."""

from collections.abc import Iterable
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.protocol.run_options import WiringKind
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.recorded_messages import first
from tests.support.replayed_runs import Runs
from tests.support.rewritten_recordings import (
    Change,
    changing,
    flipped,
    rewritten,
    saying,
    write_again,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


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
        r"tick 12: /(wiring|wavestart|state) ",
    ),
    "observation's length": (
        changing(
            wire.Observation, lambda o: o.tick == 12, lambda o: {"bits": o.bits + b"1"}
        ),
        r"tick 12: /observation: ",
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
        r"tick 12: /reached ",
    ),
    "question": (
        changing(
            wire.WaveStart,
            lambda w: w.tick == 12 and w.kind == "signal",
            lambda w: {"signal": (w.signal[0] ^ 1,)},
        ),
        r"tick 12: /wavestart ",
    ),
    "action": (
        changing(
            wire.Decision, lambda d: d.tick == 12, lambda d: {"action": d.action + 1}
        ),
        r"tick 12: /decision ",
    ),
    "reason": (
        changing(wire.Decision, lambda d: d.tick == 12, lambda _: {"why": "so"}),
        r"tick 12: /decision ",
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
