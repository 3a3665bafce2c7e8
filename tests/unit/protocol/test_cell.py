"""One cell, message by message."""

from collections import defaultdict
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from tests.support import swarm_parts
from tests.support.wave_messages import share, start, state_wave

SCENES = """
a pulse makes it pulse its targets and report
  < wiring 1 after 0 +2>4 +2>7
  < wave 1; pulse 0>2 hops 3 credit 1
  > 1: 2>4 hops 4 credit 3; 1: 2>7 hops 4 credit 3; 1.0: fired 2@3 back 2 sent 2 by 1
a signal makes it fire at no hops
  < wiring 1 after 0 +2>4
  < wave 1 of 0 2 5 credit 2
  > 1: 2>4 hops 1 credit 3; 1.0: fired 2@0 back 3 sent 1 by 1
a signal that asks others leaves it silent
  < wiring 1 after 0 +2>4
  < wave 1 of 0 5
each literal fires along its own edges, pulses before the report
  < wiring 1 after 0 +2>4 +2>6 +3>8
  < wave 1 of 2 3 credit 1
  > 1: 2>4 hops 1 credit 3; 1: 2>6 hops 1 credit 3; 1: 3>8 hops 1 credit 2
  > 1.0: fired 2@0 3@0 back 2 2 sent 3 by 1
never wired, it gives all credit back
  < wave 1 of 2 credit 5
  > 1.0: fired 2@0 back 5 sent 0 by 0
it fires once a wave, and its reports are numbered
  < wiring 1 after 0 +2>4
  < wave 1; pulse 0>2
  > 1: 2>4 hops 2 credit 4; 1.0: fired 2@1 back 4 sent 1 by 1
  < pulse 6>2 hops 9 credit 7
  > 1.1: fired none back 7 sent 0 by 1
  < pulse 8>2
  > 1.2: fired none back 3 sent 0 by 1
  < wave 2; pulse 0>2 wave 2
  > 2: 2>4 hops 2 credit 4; 2.0: fired 2@1 back 4 sent 1 by 1
the first pulse gives the hops
  < wiring 1 after 0 +2>4
  < wave 1; pulse 0>2 hops 5; pulse 6>2 hops 2
  > 1: 2>4 hops 6 credit 4; 1.0: fired 2@5 back 4 3 sent 1 by 1
a batch takes one report a wave
  < wiring 1 after 0 +2>4
  < wave 1; wave 2; pulse 0>2; pulse 0>2 wave 2; pulse 6>2
  > 1: 2>4 hops 2 credit 4; 2: 2>4 hops 2 credit 4
  > 1.0: fired 2@1 back 4 3 sent 1 by 1; 2.0: fired 2@1 back 4 sent 1 by 1
in a state wave it fires its reading
  < wiring 1 after 0 +2>5 +3>7
  < read 3 010; state 1 at 3
  > 1: 2>5 hops 1 credit 1; 1.0: fired 2@0 back 1 sent 1 by 1
  < read 4 000; state 2 at 4
  > 2: 3>7 hops 1 credit 1; 2.0: fired 3@0 back 1 sent 1 by 1
a state wave waits for its reading
  < wiring 1 after 0 +2>5 +3>7
  < read 2 010; state 1 at 3
  < pulse 0>2 credit 4
  < read 3 000
  > 1: 3>7 hops 1 credit 1; 1: 2>5 hops 2 credit 5
  > 1.0: fired 3@0 2@1 back 1 5 sent 2 by 1
a repeated state wave names the readings and waits for none
  < wiring 1 after 0 +2>5
  < state 2 at 3 of 0 3 4
  > 2.0: fired 3@0 back 0 sent 0 by 1
what was not observed does not fire in a repeat either
  < wiring 1 after 0 +2>4
  < state 1 at 1 of 0 5
a reading is kept once
  < wiring 1 after 0 +2>5
  < read 3 010; read 3 000
  < state 1 at 3
  > 1: 2>5 hops 1 credit 1; 1.0: fired 2@0 back 1 sent 1 by 1
it reports once all that is sure to pulse it has, and then what comes
  < wiring 1 after 0 +2>4 +2>6 +3>9
  < read 3 01001; state 1 at 3
  > 1: 2>4 hops 1 credit 2; 1: 2>6 hops 1 credit 2
  < pulse 5>3
  > 1: 3>9 hops 2 credit 4
  < pulse 7>3
  < pulse 8>2
  > 1.0: fired 2@0 3@1 back 1 4 3 3 sent 3 by 1
  < pulse 10>2
  > 1.1: fired none back 3 sent 0 by 1
what came before the wave counts as come
  < wiring 1 after 0 +2>4
  < pulse 5>3
  < read 3 010; state 1 at 3
  > 1: 2>4 hops 1 credit 1; 1.0: fired 2@0 3@1 back 1 3 sent 1 by 1
it waits for no pulse of a sensor whose reading is unknown
  < wiring 1 after 0 +2>4 +2>6
  < read 3 010?; state 1 at 3
  > 1: 2>4 hops 1 credit 2; 1: 2>6 hops 1 credit 2
  < pulse 5>3
  > 1.0: fired 2@0 3@1 back 1 3 sent 2 by 1
of a repeated state wave each batch is reported
  < wiring 1 after 0 +2>4
  < read 3 010; state 1 at 3
  > 1: 2>4 hops 1 credit 1
  < state 2 at 3 of 2
  > 2: 2>4 hops 1 credit 1; 2.0: fired 2@0 back 1 sent 1 by 1
  < pulse 5>3 wave 2
  > 2.1: fired 3@1 back 3 sent 0 by 1
with an unknown reading it starts no wave and passes pulses on
  < wiring 1 after 0 +2>4
  < read 1 1?1; state 1 at 1
  < pulse 0>2 credit 2
  > 1: 2>4 hops 2 credit 3; 1.0: fired 2@1 back 3 sent 1 by 1
  < state 2 at 2; pulse 0>2 wave 2
  < read 2 1?1
  > 2: 2>4 hops 2 credit 4; 2.0: fired 2@1 back 4 sent 1 by 1
  < read 3 ?1?; state 3 at 3
  > 3: 2>4 hops 1 credit 1; 3.0: fired 2@0 back 1 sent 1 by 1
it holds pulses until their wave starts, each once
  < wiring 1 after 0 +2>4
  < pulse 0>2 credit 2; pulse 6>2 credit 2; pulse 0>2 credit 2
  < pulse 0>2 wave 2
  < wave 1
  > 1: 2>4 hops 2 credit 3; 1.0: fired 2@1 back 3 2 sent 1 by 1
a held pulse fires along the wiring that came before the start
  < wiring 1 after 0 +2>4
  < pulse 0>2
  < wiring 2 after 1 +2>8 -2>4; wave 1
  > 1: 2>8 hops 2 credit 4; 1.0: fired 2@1 back 4 sent 1 by 2
a wave it was not told of makes it fire all the same
  < wiring 1 after 0 +2>4
  < wave 3
  < pulse 0>2 credit 1 wave 5 behind 3
  > 5: 2>4 hops 2 credit 2 behind 3; 5.0: fired 2@1 back 2 sent 1 by 1
it holds such a wave until its fence
  < wiring 1 after 0 +2>4
  < wave 2
  < pulse 0>2 wave 5 behind 3; ask 6 behind 3 of 2
  < wave 3
  > 5: 2>4 hops 2 credit 4 behind 3; 6: 2>4 hops 1 credit 1 behind 3
  > 5.0: fired 2@1 back 4 sent 1 by 1; 6.0: fired 2@0 back 1 sent 1 by 1
a fence that comes late counts where a later one has come
  < wiring 1 after 0 +2>4
  < wave 9; wave 3
  < pulse 0>2 wave 10 behind 9
  > 10: 2>4 hops 2 credit 4 behind 9; 10.0: fired 2@1 back 4 sent 1 by 1
only what is announced to all is a fence
  < wiring 1 after 0 +2>4
  < wave 1; ask 5 behind 1 of 0
  < pulse 0>2 wave 6 behind 5
a pulse may overtake the start and no credit is lost
  < wiring 1 after 0 +2>4
  < wave 1
  < pulse 0>2 wave 2 behind 1
  > 2: 2>4 hops 2 credit 4 behind 1; 2.0: fired 2@1 back 4 sent 1 by 1
  < ask 2 behind 1 of 2 credit 1
  > 2.1: fired none back 1 sent 0 by 1
what has settled is forgotten and stays settled
  < wiring 1 after 0 +2>4
  < wave 1; wave 2; pulse 0>2; pulse 0>2 wave 2
  > 1: 2>4 hops 2 credit 4; 2: 2>4 hops 2 credit 4; 1.0: fired 2@1 back 4 sent 1 by 1
  > 2.0: fired 2@1 back 4 sent 1 by 1
  < wave 3 below 2
  < pulse 6>2; wave 1 of 2
  < pulse 6>2 wave 2
  > 2.1: fired none back 3 sent 0 by 1
  < wave 5 below 5; wave 6 below 3
  < pulse 0>2 wave 4; wave 4 of 2 below 3
it says by which wiring it acted, and what comes after does not count
  < wiring 1 after 0 +2>4
  < wave 1 of 2; wiring 2 after 1 +2>8 -2>4; pulse 0>2; wave 2 of 2
  > 1: 2>4 hops 1 credit 1; 1.0: fired 2@0 back 1 sent 1 by 1; 2: 2>8 hops 1 credit 1
  > 1.1: fired none back 3 sent 0 by 2; 2.0: fired 2@0 back 1 sent 1 by 2
changes build on the wiring before
  < wiring 1 after 0 +2>4 +2>6 +3>8
  < wiring 2 after 1 +2>9 -2>4 +3>5 -3>8
  < wave 1 of 2 3
  > 1: 2>6 hops 1 credit 2; 1: 2>9 hops 1 credit 2; 1: 3>5 hops 1 credit 1
  > 1.0: fired 2@0 3@0 back 1 1 sent 3 by 2
a whole wiring forgets the one before
  < wiring 1 after 0 +2>4 +2>6 +3>8
  < wiring 7 after 0 +2>9
  < wave 1 of 2 3
  > 1: 2>9 hops 1 credit 1; 1.0: fired 2@0 3@0 back 1 0 sent 1 by 7
a wiring that comes again changes nothing
  < wiring 1 after 0 +2>4
  < wiring 2 after 1 +2>6 -2>4; wiring 2 after 1 +2>6 -2>4
  < wiring 1 after 0 +2>4
  < wave 1 of 2
  > 1: 2>6 hops 1 credit 1; 1.0: fired 2@0 back 1 sent 1 by 2
a gap in the wirings silences it until it is wired whole
  < wiring 1 after 0 +2>4
  < wiring 3 after 2 +2>6
  > wiring: must build on epoch 1, got 2
  < wiring 4 after 3 +2>8
  > wiring: must build on epoch 1, got 3
  < wave 1 of 2; pulse 0>2; read 1 010; state 2 at 1
  < wiring 5 after 0 +2>4 +2>6
  < wave 3 of 2 below 3
  > 3: 2>4 hops 1 credit 2; 3: 2>6 hops 1 credit 2; 3.0: fired 2@0 back 1 sent 2 by 5
a change of a wiring that was replaced is a gap
  < wiring 1 after 0 +2>4
  < wiring 2 after 1 +2>6
  < wiring 3 after 1 +2>8
  > wiring: must build on epoch 2, got 1
"""
"""What the cell of sensor 1 receives in batches, and what it sends for each.

A pulse is of wave 1 and has 3 of credit, if it does not say. What pulses a literal is
the complement of what its complement pulses: where sensor 2 is off, literal 5 is read,
and a cell with the edge 2 -> 4 is pulsed along 5 -> 3.
"""


def received(text: str) -> wire.Message:
    """Return the message that a text stands for, such as ``wave 1 of 2 5``."""
    kind, first, *words = text.split()
    given: dict[str, list[int]] = {}
    numbers: list[int] = []
    for word in words:
        if word.isalpha():
            numbers = given.setdefault(word, [])
        elif word.isdecimal():
            numbers.append(int(word))

    def of(name: str, default: int = 0) -> int:
        return given.get(name, [default])[0]

    signal, credit = given.get("of", []), of("credit")
    match kind:
        case "wave":
            return start(int(first), *signal, credit=credit, below=of("below", 1))
        case "state":
            return state_wave(int(first), of("at"), *signal)
        case "ask":
            more = (credit, 1, tuple(signal), 0, of("behind"), 1)
            return wire.WaveStart(int(first), 0, "signal", *more)
        case "pulse":
            source, target = map(int, first.split(">"))
            wave, much = of("wave", 1), (of("hops", 1), of("credit", 3))
            return wire.Pulse(wave, source, target, *much, of("behind", wave))
        case "read":
            digits = {"1": True, "0": False, "?": None}
            return swarm_parts.observation(int(first), [digits[d] for d in words[0]])
        case _:
            add, drop, add_complement, drop_complement = (
                tuple(int(word[3:]) for word in words if word.startswith(sign))
                for sign in ("+2", "-2", "+3", "-3")
            )
            changes = add, drop, add_complement, drop_complement
            return wire.Wiring(1, int(first), of("after"), *changes)


def shown(message: wire.Message) -> str:
    """Return what a cell sends as a text."""
    match message:
        case wire.Pulse(wave, source, target, hops, credit, fence):
            behind = "" if fence == wave else f" behind {fence}"
            return f"{wave}: {source}>{target} hops {hops} credit {credit}{behind}"
        case wire.CellReport(wave, _, part, literals, hops, credit, pulses, epoch):
            each = zip(literals, hops, strict=True)
            fired = " ".join(f"{literal}@{hop}" for literal, hop in each) or "none"
            back = " ".join(map(str, credit))
            return f"{wave}.{part}: fired {fired} back {back} sent {pulses} by {epoch}"
        case wire.Fault(_, what):
            return what
        case _:
            raise AssertionError(message)


def scenes() -> dict[str, list[tuple[str, str]]]:
    """Return what is received and sent, batch by batch, by the name of a scene."""
    found: dict[str, list[tuple[str, str]]] = {}
    batches: list[tuple[str, str]] = []
    for line in SCENES.strip().splitlines():
        mark, text = line[:3].strip(), line[3:].strip()
        if mark == "<":
            batches.append((text, ""))
        elif mark == ">":
            batch, said = batches[-1]
            batches[-1] = batch, f"{said}; {text}" if said else text
        else:
            batches = found[line] = []
    return found


@pytest.mark.parametrize("name", scenes())
def test_what_it_sends_for_what_it_receives(name: str) -> None:
    cell = Cell(1)
    for batch, expected in scenes()[name]:
        said = cell.receive([received(text) for text in batch.split("; ")])
        assert "; ".join(map(shown, said)) == expected, batch


few, some, any_number = st.integers(0, 4), st.integers(1, 4), st.integers(0, 9)
literals, to = st.lists(any_number).map(tuple), st.sampled_from([-1, 1])
kinds = st.sampled_from(["state", "signal"])
messages = (
    st.builds(wire.Pulse, some, any_number, any_number, some, any_number, few)
    | st.builds(
        *(wire.WaveStart, some, few, kinds, few, some, literals, st.just(0), few, to)
    )
    | st.builds(wire.Observation, st.integers(1, 12), st.binary(max_size=2))
    | st.builds(wire.Wiring, st.integers(0, 2), some, few, literals, literals)
)


@given(st.lists(messages, max_size=30))
@example(
    [
        wire.WaveStart(2, 0, "state", 2, 3),
        wire.WaveStart(2, 0, "state", 0, 1, (2,)),
        wire.Pulse(1, 0, 0, 1, 0, 0),
    ]
)
def test_no_message_is_an_exception_and_no_credit_is_made(
    messages: list[wire.Message],
) -> None:
    cell, starts, ways = Cell(1), set[int](), set[tuple[int, int, int]]()
    came, went = (
        defaultdict[int, Fraction](Fraction),
        defaultdict[int, Fraction](Fraction),
    )
    for message in messages:
        if isinstance(message, wire.Pulse):
            way = (message.wave, message.source, message.target)
            if way not in ways:
                ways.add(way)
                came[message.wave] += share(message.credit)
        elif (
            isinstance(message, wire.WaveStart)
            and message.wave not in starts
            and message.settled_below <= message.wave  # else it is refused
        ):
            starts.add(message.wave)
            came[message.wave] += 2 * share(message.credit)
        for sent in cell.receive([message]):
            match sent:
                case wire.Pulse(wave=wave, credit=credit):
                    went[wave] += share(credit)
                case wire.CellReport(wave=wave, credit=back):
                    went[wave] += sum(map(share, back))
                case _:
                    pass
    assert all(went[wave] <= came[wave] for wave in went)
