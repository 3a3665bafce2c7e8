"""The coordinator's core, with cells at hand that answer at once and in order."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.policy import Policy
from neurosnap.agent.random_walk import Walker
from neurosnap.errors import WaveLostError
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.sensorium import complete, pack, unpack
from tests.support import oracles
from tests.support.answering_swarm import AnsweringSwarm

SENSORS = 3
M = TypeVar("M")
Bits = NDArray[np.bool_]


def bits(text: str) -> Bits:
    """Return the readings in a row of 0 and 1."""
    return np.array([digit == "1" for digit in text])


def observed(tick: int, text: str) -> wire.Observation:
    return wire.Observation(tick, pack(bits(text)))


# Sensor 0 implies sensor 1, until the last row contradicts it.
ROWS = ["000", "110", "010", "111", "011", "000", "110", "100"]


class Asks:
    """Asks fixed questions and keeps the answers."""

    def __init__(self, *questions: tuple[int, ...]) -> None:
        self.questions = questions
        self.answers: list[list[Bits]] = []

    def ask(self, tick: int, state: Bits) -> list[tuple[int, ...]]:
        return list(self.questions)

    def decide(
        self, tick: int, state: Bits, answers: Sequence[Bits]
    ) -> tuple[int, str]:
        self.answers.append([answer.copy() for answer in answers])
        return tick, "as asked"


def new(
    policy: Policy | None = None, ticks: int = len(ROWS), **options: int
) -> Coordinator:
    return Coordinator(
        EmpiricalSnapshot(SENSORS, threshold=0.2),
        policy or Walker(2, 7),
        ticks=ticks,
        keyframe_every=options.get("keyframe_every", 1000),
        repeats=options.get("repeats", 2),
    )


def learned(rows: Sequence[str]) -> PocGraph:
    """Return the graph that `rows` teach."""
    snapshot = EmpiricalSnapshot(SENSORS, threshold=0.2)
    for row in rows:
        snapshot.observe(bits(row))
    return snapshot.poc_graph()


def above(rows: Sequence[str], *questions: tuple[int, ...]) -> list[list[bool]]:
    """Return what each question's literals imply once `rows` were seen."""
    graph = learned(rows)
    return [graph.up(question).tolist() for question in questions]


class Swarm(AnsweringSwarm):
    """A coordinator and three cells; readings are a text."""

    def __init__(
        self, core: Coordinator, lost: Callable[[wire.Message], bool] = lambda _: False
    ) -> None:
        super().__init__(core, SENSORS, lost=lost)

    def observe(self, tick: int, text: str) -> list[wire.Message]:
        return self.say([observed(tick, text)])

    def run(self, rows: Sequence[str]) -> list[wire.Message]:
        said = self.say(self.core.begin())
        for tick, row in enumerate(rows, 1):
            said += self.observe(tick, row)
        return said


def only(kind: type[M], messages: Sequence[wire.Message]) -> list[M]:
    return [message for message in messages if isinstance(message, kind)]


# A run --------------------------------------------------------------------------------


def test_the_states_are_those_of_the_snapshot() -> None:
    states = only(wire.State, Swarm(new()).run(ROWS))
    snapshot = EmpiricalSnapshot(SENSORS, threshold=0.2)
    expected = [snapshot.observe(bits(row)) for row in ROWS]
    assert [unpack(s.literals, 2 * SENSORS).tolist() for s in states] == [
        state.tolist() for state in expected
    ]
    assert [s.tick for s in states] == list(range(1, len(ROWS) + 1))


def test_an_observation_against_what_was_learned_is_marked() -> None:
    states = only(wire.State, Swarm(new()).run(ROWS))
    contradicted = [s.incoherent for s in states]
    assert contradicted[-1]
    assert not any(contradicted[:-1])
    # Sensors 0 and 1 contradict each other and drop out; sensor 2 stays.
    assert unpack(states[-1].literals, 6).tolist() == [False] * 5 + [True]


def test_a_state_says_what_its_wave_took() -> None:
    swarm = Swarm(new())
    said = swarm.run(ROWS)
    for state in only(wire.State, said):
        reports = [
            r for r in only(wire.CellReport, swarm.heard) if r.wave == state.wave
        ]
        assert state.pulses == sum(r.pulses for r in reports)
        assert state.depth == max(h for r in reports for h in r.hops)
    assert any(state.pulses for state in only(wire.State, said))


def test_it_opens_with_a_decision_and_takes_one_a_tick() -> None:
    decisions = only(wire.Decision, Swarm(new(Asks())).run(ROWS))
    assert decisions[0] == wire.Decision(0, -1, "the run begins")
    assert [(d.tick, d.action) for d in decisions[1:]] == [
        (tick, tick) for tick in range(1, len(ROWS))
    ]


def test_the_last_tick_ends_the_run_with_a_whole_snapshot() -> None:
    swarm = Swarm(new(Asks()))
    said = swarm.run(ROWS)
    frame = said[-1]
    assert isinstance(frame, wire.KeyFrame)
    assert frame.tick == len(ROWS)
    assert swarm.core.finished
    restored = EmpiricalSnapshot.from_bytes(frame.snapshot)
    assert restored.clock == len(ROWS)
    assert swarm.observe(len(ROWS) + 1, "000") == []


def test_whole_snapshots_go_out_every_so_many_ticks() -> None:
    said = Swarm(new(Asks(), keyframe_every=3)).run(ROWS)
    assert [frame.tick for frame in only(wire.KeyFrame, said)] == [3, 6, 8]


def test_a_run_can_go_on() -> None:
    swarm = Swarm(new(Asks(), ticks=3))
    swarm.run(ROWS[:3])
    swarm.core.go_on(5)
    opening = swarm.say(swarm.core.begin())
    assert opening[-1] == wire.Decision(3, 3, "as asked")
    swarm.observe(4, ROWS[3])
    said = swarm.observe(5, ROWS[4])
    assert isinstance(said[-1], wire.KeyFrame)
    assert swarm.core.tick == 5


def test_totals_add_up() -> None:
    swarm = Swarm(new())
    said = swarm.run(ROWS)
    totals = swarm.core.totals
    states, reached = only(wire.State, said), only(wire.Reached, said)
    waves: list[wire.State | wire.Reached] = [*states, *reached]
    assert totals.ticks == len(states) == len(ROWS)
    assert totals.waves == len(only(wire.WaveStart, said)) == len(waves)
    assert totals.pulses == sum(wave.pulses for wave in waves) > 0
    assert totals.depth == max(wave.depth for wave in waves)
    assert totals.height == states[-1].height
    assert totals.edges == states[-1].edges > 0
    assert totals.incoherent == 1
    assert totals.faults == 0


def test_the_same_messages_get_the_same_answers_byte_for_byte() -> None:
    swarm = Swarm(new(keyframe_every=2))
    swarm.run(ROWS)

    def answers() -> list[list[bytes]]:
        core = new(keyframe_every=2)
        said = [core.begin(), *(core.receive(message) for message in swarm.heard)]
        return [[wire.encode(message) for message in burst] for burst in said]

    first = answers()
    assert len(swarm.heard) > 20
    assert answers() == first
    assert any(b'"decision"' in payload for burst in first for payload in burst)


def test_the_state_is_what_the_cells_reported_and_nothing_else() -> None:
    core = new(Asks())
    core.begin()
    core.receive(observed(1, "000"))
    # Nobody has learned that sensor 1 is on, and yet its cell says so.
    reports = [
        wire.CellReport(1, 0, 0, (1,), (0,), (2,), 0, epoch=2),
        wire.CellReport(1, 1, 0, (3, 2), (0, 1), (2,), 0, epoch=2),
        wire.CellReport(1, 2, 0, (5,), (0,), (2,), 0, epoch=2),
    ]
    (state,) = only(wire.State, [m for r in reports for m in core.receive(r)])
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [1, 5]
    assert state.incoherent
    assert state.depth == 1


# Unknown readings ---------------------------------------------------------------------


def partly(tick: int, row: str) -> wire.Observation:
    """An observation, `?` standing for what is unknown."""
    known = pack([digit != "?" for digit in row])
    return wire.Observation(tick, pack(bits(row)), known=known)


def test_what_is_implied_of_an_unknown_reading_is_in_the_state() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:4])  # sensor 0 implies sensor 1
    said = swarm.say([partly(5, "1??")])
    start = only(wire.WaveStart, said)[0]
    assert (start.kind, start.credit) == ("state", 0)
    (state,) = only(wire.State, said)
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [0, 2]
    assert not state.incoherent
    (state,) = only(wire.State, swarm.say([partly(6, "?1?")]))
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [2]


def test_what_is_unknown_is_not_learned_from() -> None:
    swarm, snapshot = Swarm(new()), EmpiricalSnapshot(SENSORS, threshold=0.2)
    swarm.run(ROWS[:4])
    swarm.say([partly(5, "1?0")])
    for row in ROWS[:4]:
        snapshot.learn(bits(row))
    snapshot.learn(bits("1?0"), np.array([True, False, True]))
    assert swarm.core.snapshot.clock == 5
    for a, b in oracles.proper_pairs(2 * SENSORS):
        assert swarm.core.snapshot.weight(a, b) == snapshot.weight(a, b)


def test_a_partial_observation_that_contradicts_what_was_learned_says_so() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:7])
    (state,) = only(wire.State, swarm.say([partly(8, "10?")]))
    assert state.incoherent
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [5]


def test_everything_known_is_the_same_said_or_not() -> None:
    said, plain = Swarm(new()), Swarm(new())
    said.run(ROWS[:4])
    plain.run(ROWS[:4])
    whole = wire.Observation(5, pack(bits(ROWS[4])), known=b"\x07")
    assert said.say([whole]) == plain.observe(5, ROWS[4])


@pytest.mark.parametrize(
    ("known", "what"),
    [
        (b"\x07\x00", "must say which of 1 bytes are known, got 2 bytes"),
        (b"\x06", "must be 0 where it is not known, got sensor 0 on"),
        (b"\x09", "packed bits: must be 0 beyond the first 3 bits, got b'\\t'"),
    ],
)
def test_an_observation_that_contradicts_itself_is_a_fault(
    known: bytes, what: str
) -> None:
    core = new()
    core.begin()
    wrong = wire.Observation(1, b"\x01", known=known)
    assert core.receive(wrong) == [wire.Fault("coordinator", f"observe: {what}")]
    assert core.snapshot.clock == 0
    assert only(wire.WaveStart, core.receive(observed(1, "000")))


def test_a_late_wave_is_repeated_with_what_is_known() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:4])
    swarm.lost = lambda m: isinstance(m, wire.CellReport)
    swarm.say([partly(5, "?10")])
    swarm.lost = lambda _: False
    said = swarm.say(swarm.core.overdue(swarm.core.in_flight[0]))
    start = only(wire.WaveStart, said)[0]
    assert (start.kind, start.signal, start.credit) == ("state", (2, 5), 1)
    assert only(wire.State, said)


# Planning waves -----------------------------------------------------------------------


def test_questions_are_answered_before_it_decides() -> None:
    policy = Asks((0,), (2, 5), (3,))
    said = Swarm(new(policy)).run(ROWS[:4])
    assert [type(m) for m in said[-8:]] == [
        wire.State,
        *[wire.WaveStart] * 3,
        *[wire.Reached] * 3,
        wire.Decision,
    ]
    answers = [answer.tolist() for answer in policy.answers[-1]]
    assert answers == above(ROWS[:4], (0,), (2, 5), (3,))
    assert sum(answers[0]) > 1


def test_answers_come_in_the_order_of_the_questions_however_waves_settle() -> None:
    policy = Asks((0,), (3,))
    core = new(policy)
    core.begin()
    core.receive(observed(1, "000"))
    reports = [
        wire.CellReport(1, c, 0, (2 * c + 1,), (0,), (2,), 0, epoch=2) for c in range(3)
    ]
    said = [message for report in reports for message in core.receive(report)]
    assert [m.wave for m in only(wire.WaveStart, said)] == [2, 3]
    (reached,) = core.receive(wire.CellReport(3, 1, 0, (3,), (0,), (0,), 0, epoch=2))
    assert isinstance(reached, wire.Reached)
    assert (reached.wave, reached.signal) == (3, (3,))
    said = core.receive(wire.CellReport(2, 0, 0, (0,), (0,), (0,), 0, epoch=2))
    assert [type(m) for m in said] == [wire.Reached, wire.Decision]
    answers = [np.flatnonzero(a).tolist() for a in policy.answers[-1]]
    assert answers == [[0], [3]]


# Out of turn --------------------------------------------------------------------------


@pytest.mark.parametrize("tick", [1, 2, 4, 9])
def test_an_observation_out_of_turn_is_a_fault_and_changes_nothing(tick: int) -> None:
    swarm, other = Swarm(new()), Swarm(new())
    swarm.run(ROWS[:2])
    other.run(ROWS[:2])
    fault = wire.Fault("coordinator", f"observe: must be tick 3, once, got tick {tick}")
    assert swarm.core.receive(observed(tick, "111")) == [fault]
    assert swarm.core.receive(fault) == []  # as it comes back to it
    assert swarm.core.totals.faults == 1
    assert swarm.observe(3, ROWS[2]) == other.observe(3, ROWS[2])


def test_a_second_observation_while_waves_fly_is_a_fault() -> None:
    core = new()
    core.begin()
    core.receive(observed(1, "000"))
    (fault,) = core.receive(observed(1, "111"))
    assert fault == wire.Fault(
        "coordinator", "observe: must be tick 1, once, got tick 1"
    )
    assert core.in_flight == (1,)


@pytest.mark.parametrize(
    ("packed", "what"),
    [
        (b"", "packed bits: must be 1 bytes long for 3 bits, got 0"),
        (b"\0\0", "packed bits: must be 1 bytes long for 3 bits, got 2"),
        (b"\x08", "packed bits: must be 0 beyond the first 3 bits, got b'\\x08'"),
    ],
)
def test_an_observation_of_another_length_is_a_fault(packed: bytes, what: str) -> None:
    core = new()
    core.begin()
    assert core.receive(wire.Observation(1, packed)) == [
        wire.Fault("coordinator", f"observe: {what}")
    ]
    assert core.in_flight == ()
    assert only(wire.WaveStart, core.receive(observed(1, "000")))


@pytest.mark.parametrize(
    ("message", "what"),
    [
        (
            wire.CellReport(1, 9, 0, (18,), (0,), (2,), 0),
            r"settle: must be a cell's, got cell 9",
        ),
        (
            wire.CellReport(1, 0, 0, (1,), (0,), (0, 0), 0, epoch=2),
            r"settle: must give back at most the credit given out, got cell 0,"
            r" credit [0, 0]",
        ),
        (wire.Pulse(1, 0, 2, 1, 0), "excite: is not for the coordinator"),
        (wire.Decision(0, 0, ""), "decide: is not for the coordinator"),
    ],
)
def test_what_cannot_be_right_is_a_fault_and_changes_nothing(
    message: wire.Message, what: str
) -> None:
    core = new()
    core.begin()
    core.receive(observed(1, "000"))
    fault = wire.Fault("coordinator", what)
    assert core.receive(message) == [fault]
    assert core.receive(fault) == []  # as it comes back to it
    assert core.in_flight == (1,)
    assert core.totals.faults == 1


def test_faults_of_others_are_counted() -> None:
    core = new()
    assert core.receive(wire.Fault("cell/1", "pulse: must be for this cell")) == []
    assert core.totals.faults == 1


# Late waves ---------------------------------------------------------------------------


def test_an_overdue_wave_is_sent_again_with_whole_wirings() -> None:
    swarm = Swarm(new(Asks()))
    swarm.run(ROWS[:4])
    swarm.lost = lambda m: isinstance(m, wire.CellReport) and m.cell == 1
    swarm.observe(5, ROWS[4])
    assert swarm.core.in_flight == (5,)
    swarm.lost = lambda _: False
    said = swarm.say(swarm.core.overdue(5))
    wirings = only(wire.Wiring, said)
    assert all(wiring.after == 0 for wiring in wirings)
    edges = {
        (literal, target)
        for wiring in wirings
        for literal, targets in (
            (2 * wiring.cell, wiring.add),
            (2 * wiring.cell + 1, wiring.add_complement),
        )
        for target in targets
    }
    assert edges == set(zip(*learned(ROWS[:5]).hasse().nonzero(), strict=True))
    (start,) = only(wire.WaveStart, said)
    literals = tuple(np.flatnonzero(complete(bits(ROWS[4]))).tolist())
    assert start == wire.WaveStart(6, 5, "state", 2, 6, literals, 5, 6)
    (state,) = only(wire.State, said)
    undisturbed = only(wire.State, Swarm(new(Asks())).run(ROWS[:5]))[-1]
    assert (state.tick, state.wave, state.literals) == (5, 6, undisturbed.literals)
    assert said[-1] == wire.Decision(5, 5, "as asked")


def test_an_overdue_planning_wave_still_answers_its_question() -> None:
    policy = Asks((0,), (3,))
    swarm = Swarm(new(policy))
    swarm.run(ROWS[:4])
    before = len(policy.answers)

    def loses(message: wire.Message) -> bool:
        return isinstance(message, wire.Pulse) and message.source == 0

    swarm.lost = loses
    swarm.observe(5, "000")
    assert len(policy.answers) == before
    (late,) = swarm.core.in_flight
    swarm.lost = lambda _: False
    said = swarm.say(swarm.core.overdue(late))
    (reached,) = only(wire.Reached, said)
    assert (reached.wave, reached.signal) == (late + 2, (0,))
    answers = [answer.tolist() for answer in policy.answers[-1]]
    assert answers == above([*ROWS[:4], "000"], (0,), (3,))


def test_a_wave_that_stays_lost_names_credit_and_silent_cells() -> None:
    swarm = Swarm(
        new(Asks(), repeats=1),
        lost=lambda m: isinstance(m, wire.CellReport) and m.cell == 2,
    )
    swarm.run(ROWS[:1])
    assert swarm.core.in_flight == (1,)
    assert only(wire.State, swarm.say(swarm.core.overdue(1))) == []
    expected = (
        r"^wave 2 \(tick 1\): must settle within its deadline, got 2 tries;"
        r" missing credit 0\.\d+, silent cells: cell/2$"
    )
    with pytest.raises(WaveLostError, match=expected):
        swarm.core.overdue(2)


# The end ------------------------------------------------------------------------------


def test_asked_to_stop_between_ticks_it_ends_at_once() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:2])
    (frame,) = swarm.core.stop()
    assert isinstance(frame, wire.KeyFrame)
    assert frame.tick == 2
    assert swarm.core.finished
    assert swarm.observe(3, ROWS[2]) == []


def test_asked_to_stop_within_a_tick_it_ends_the_tick_first() -> None:
    swarm = Swarm(new(Asks()))
    swarm.run(ROWS[:2])
    starts = swarm.core.receive(observed(3, ROWS[2]))
    assert swarm.core.stop() == []
    assert not swarm.core.finished
    for host in swarm.hosts:
        host.receive([observed(3, ROWS[2])])
    said = swarm.say(starts)
    assert [m.tick for m in only(wire.State, said)] == [3]
    assert only(wire.Decision, said) == []
    assert [m.tick for m in only(wire.KeyFrame, said)] == [3]
    assert swarm.core.finished


def test_asked_to_stop_before_the_first_tick_it_leaves_nothing() -> None:
    core = new()
    core.begin()
    assert core.stop() == []
    assert core.finished


def test_asked_to_stop_twice_it_ends_once() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:2])
    assert len(swarm.core.stop()) == 1
    assert swarm.core.stop() == []
