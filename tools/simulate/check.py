"""The expected result of a simulated run, compared with its recording.

Nothing here knows of waves: the state is what the snapshot says, an answer is what is
above in the learned order, and the wirings are added up as they come.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.tick import Mind, Sensed, Step, answered_at_once, tick
from neurosnap.poc.order.graph import WiringKind
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.sensorium import pack, selection
from neurosnap.sources.protocol import Observed
from tools.simulate.source import source_of

Said = tuple[object, ...]
Edges = set[tuple[int, int]]

_TOPICS = ("observation", "state", "reached", "decision")


class WrongError(Exception):
    """A simulated run did not have its expected result."""


class Truth(msgspec.Struct):
    """A run without any network."""

    said: dict[str, list[Said]]
    """By topic what there is to be said, in order, without numbers of waves."""
    edges: dict[int, Edges]
    """At each tick, along which edges the cells pulse."""


def truth(options: RunOptions, came: Sequence[Observed] = ()) -> Truth:
    """Make the run in process; `came` is what came from outside, if it did."""
    found = Truth(dict[str, list[Said]]((topic, []) for topic in _TOPICS), {})
    source = source_of(options)
    memory, snapshot = options.new_memory(), options.new_snapshot()
    mind = Mind(snapshot, options.new_policy(memory), memory)
    senses = Senses(memory.body)
    for number in range(1, options.ticks + 1):
        found.said["decision"].append(msgspec.structs.astuple(mind.decision))
        action = mind.decision.action
        seen = source.first() if number == 1 else source.step(action)
        seen = came[number - 1] if came else seen
        if seen is None:
            break
        read = seen.bits if seen.known is None else seen.bits & seen.known
        senses.fit(memory.body)
        step = action, snapshot.state, seen.begins
        observed, known = senses.observe(read, seen.known, *step)
        mask = b"" if known is None else pack(known)
        said = number, pack(observed), mask, seen.begins
        found.said["observation"].append((*said, *_received(seen)))
        _go_through(mind, Sensed(observed, known, seen.begins), found, options.wiring)
    source.close()
    _sort(found.said)
    return found


def _go_through(mind: Mind, sensed: Sensed, found: Truth, wiring: WiringKind) -> None:
    """Go through a tick, and note what is said in it."""
    steps, answer, number = tick(mind, sensed), None, mind.decision.tick + 1
    with suppress(StopIteration):
        while True:
            request = steps.send(answer)
            answer = answered_at_once(request, mind, sensed)
            graph = mind.snapshot.poc_graph()
            if request is Step.STATE_WAVE:
                found.edges[number] = _pairs(graph.wiring(wiring))
                above = graph.up(selection(sensed.bits, sensed.known))
                incoherent = bool((above[::2] & above[1::2]).any())
                state = pack(mind.snapshot.state)
                found.said["state"].append((number, state, incoherent))
            elif isinstance(request, list):
                found.said["reached"] += [
                    (number, signal, pack(graph.up(signal))) for signal in request
                ]


def _received(seen: Observed | wire.Observation) -> Said:
    """Return what was received by then, and why nothing was since the tick before."""
    return seen.received, tuple(outage.why for outage in seen.outages)


def _pairs(edges: NDArray[np.bool_]) -> Edges:
    return {(int(a), int(b)) for a, b in np.argwhere(edges)}


def check(
    log: Path,
    options: RunOptions,
    completeness: Completeness,
    sent: dict[str, int],
    came: Sequence[Observed] = (),
) -> None:
    """Hold the recording of a run that has ended against what it must be.

    Args:
        log: The recording.
        options: What was run.
        completeness: What the recorder said of it.
        sent: How many messages each part numbered, in all its lives.
        came: As in `truth`.

    Raises:
        WrongError: It differs; the text says where.
    """
    recorded = list(Recording.open(log).messages())
    _check_completeness(recorded, completeness, sent)
    true, said = truth(options, came), _said(recorded)
    for topic, expected in true.said.items():
        found = said[topic]
        # Of two imagined states a planner may ask the same.
        beyond = list((Counter(found) - Counter(expected)).elements())
        _demand(not beyond, f"{topic}, beyond the truth", beyond, [])
        lacking = list((Counter(expected) - Counter(found)).elements())
        _demand(not (lacking and completeness.whole), topic, [], lacking)
        _demand(
            found == expected or bool(lacking), f"{topic}, in order", found, expected
        )
    if not completeness.whole:
        return
    _check_wirings(recorded, true)
    verdict = verify(log)
    _demand(verdict.same, "replay", verdict.difference, None)
    _demand(verdict.complete, "complete", verdict, completeness)
    _demand(verdict.ticks == len(true.edges), "ticks", verdict.ticks, len(true.edges))


def _demand(held: bool, what: str, found: object, expected: object) -> None:
    if not held:
        raise WrongError(f"{what}: must be {expected!r:.500}, got {found!r:.500}")


def _check_completeness(
    recorded: list[Recorded], completeness: Completeness, sent: dict[str, int]
) -> None:
    """What is missing is exactly what was sent and is not there."""
    held: dict[str, set[int]] = {who: set() for who in sent}
    for one in recorded:
        numbers = held[one.message.sender]
        _demand(one.sequence not in numbers, "number", one, "new")
        numbers.add(one.sequence)
    for who, count in sent.items():
        lacking, noted = count - len(held[who]), completeness.missing.get(who, 0)
        # Where the last word is lost nobody can know how many came before it.
        knows = count - 1 in held[who]
        held_up = noted == lacking if knows else 0 < noted <= lacking
        _demand(held_up, f"missing of {who}", noted, lacking)


def _said(recorded: Iterable[Recorded]) -> dict[str, list[Said]]:
    """Return what was said, as in `Truth`."""
    said: dict[str, list[Said]] = {topic: [] for topic in _TOPICS}
    for one in recorded:
        match one.message:
            case wire.Observation() as m:
                seen = m.tick, m.bits, m.known, m.begins
                said["observation"].append((*seen, *_received(m)))
            case wire.State() as m:
                said["state"].append((m.tick, m.literals, m.incoherent))
            case wire.Reached() as m:
                said["reached"].append((m.tick, m.signal, m.literals))
            case wire.Decision() as m:
                said["decision"].append(msgspec.structs.astuple(m))
            case _:
                pass
    _sort(said)
    return said


def _sort(said: dict[str, list[Said]]) -> None:
    """Planning waves of one tick may settle in any order."""
    said["reached"].sort(key=repr)


def _check_wirings(recorded: Iterable[Recorded], true: Truth) -> None:
    """Add up what the cells were told: at each state wave it is the order learned."""
    told: dict[str, Edges] = {}
    epochs: dict[str, int] = {}
    for one in recorded:
        message = one.message
        if isinstance(message, wire.Wiring | wire.WorkerWiring):
            key = message.key
            after = epochs.get(key, 0)
            _demand(message.after in (0, after), "wiring", message, after)
            _demand(message.epoch > after, "wiring", message, after)
            epochs[key] = message.epoch
            kept = told.get(key, set()) if message.after else set()
            add, drop = _changes(message)
            told[key] = (kept - drop) | add
        elif isinstance(message, wire.WaveStart) and message.kind == "state":
            edges = set().union(*told.values())
            expected = true.edges[message.tick]
            _demand(edges == expected, f"wired at {message.tick}", edges, expected)


def _changes(message: wire.Wiring | wire.WorkerWiring) -> tuple[Edges, Edges]:
    """Return the edges that a message adds, and those that it takes away."""
    if isinstance(message, wire.WorkerWiring):
        changes = (
            wire.numbers("workerwiring", raw) for raw in (message.add, message.drop)
        )
        added, dropped = (
            set(zip(flat[::2], flat[1::2], strict=True)) for flat in changes
        )
        return added, dropped
    own, other = 2 * message.cell, 2 * message.cell + 1
    return (
        {(own, b) for b in message.add} | {(other, b) for b in message.add_complement},
        {(own, b) for b in message.drop}
        | {(other, b) for b in message.drop_complement},
    )
