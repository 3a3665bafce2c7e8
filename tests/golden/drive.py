"""Drives the pure cores of a whole swarm, message by message, without loop or clock.

A run is a function of its options, its source and one seed: who gets the next message
is drawn here, so that nothing but the cores themselves can change what comes out.
"""

import random
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec

from neurosnap import wire
from neurosnap.fabric.in_memory import matches
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_shares import shares
from neurosnap.protocol.world import World
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.runtime.parts.coordinator_process import coordinator_for
from neurosnap.runtime.parts.recorder_process import describe
from neurosnap.sources.protocol import Source

Messages = list[wire.Message]
Receive = Callable[[wire.Message], Messages]
Lost = Callable[[str, wire.Message], bool]
"""Whether a message does not reach a part, by the part's name."""
BETWEEN = 20_000_000
"""Nanoseconds from one recorded message to the next."""


class Step(msgspec.Struct, frozen=True):
    """One message that the coordinator received, and what it published for it."""

    tick: int
    """The tick that was under way."""
    received: str
    """The class of the message; `begin` and `overdue` are no messages."""
    published: Messages


class Driven(msgspec.Struct):
    """What came of driving a swarm."""

    core: Coordinator
    steps: list[Step] = []
    published: Messages = []
    """What all parts published, in order."""

    def seen_by_coordinator(self) -> Iterator[wire.Message]:
        """Return the observations, and all that the coordinator published."""
        for message in self.published:
            if message.sender in ("world", "coordinator"):
                yield message


class _Links:
    """Carries messages from part to part; each link keeps its order."""

    def __init__(self, seed: int | None, lost: Lost) -> None:
        self._random = None if seed is None else random.Random(seed)
        self._lost = lost
        self._parts: dict[str, tuple[tuple[str, ...], Receive]] = {}
        self._routes: dict[str, list[str]] = {}
        self._waiting: dict[tuple[str, str], deque[wire.Message]] = {}
        self._turns: list[tuple[str, str]] = []

    def join(self, who: str, keys: Sequence[str], receive: Receive) -> None:
        """Let a part take part."""
        self._parts[who] = tuple(keys), receive

    def send(self, message: wire.Message) -> None:
        """Put a message on its way to all who listen."""
        route = self._routes.get(message.key)
        if route is None:
            route = self._routes[message.key] = [
                who
                for who, (keys, _) in self._parts.items()
                if any(matches(key, message.key) for key in keys)
            ]
        for who in route:
            if not self._lost(who, message):
                link = message.sender, who
                self._waiting.setdefault(link, deque()).append(message)
                self._turns.append(link)

    def deliver(self) -> tuple[str, wire.Message, Messages] | None:
        """Deliver one message; return who got it, it, and the answers."""
        if not self._turns:
            return None
        chance = self._random
        place = 0 if chance is None else chance.randrange(len(self._turns))
        link = self._turns.pop(place)
        message = self._waiting[link].popleft()
        return link[1], message, self._parts[link[1]][1](message)


def drive(
    options: RunOptions,
    source: Source,
    seed: int | None = None,
    past: ResumePoint | None = None,
    lost: Lost = lambda _who, _message: False,
    until: int | None = None,
) -> Driven:
    """Make a run.

    Args:
        options: What to run.
        source: What its world shows; closed here.
        seed: Draws whose message is next; None: first come, first served.
        past: Where it goes on from, if it does.
        lost: Which messages do not arrive.
        until: All die in the tick after this one; None: none does.
    """
    core = coordinator_for(options, past)
    driven, links = Driven(core), _Links(seed, lost)
    _join(links, options, core, source, past)

    def publish(received: str, messages: Messages) -> None:
        # What is sent may go on changing: a band is a view into what is learned.
        sent = [wire.decode(m.key, wire.encode(m)) for m in messages]
        driven.steps.append(Step(core.tick, received, sent))
        send(sent)

    def send(messages: Messages) -> None:
        for message in messages:
            driven.published.append(message)
            links.send(message)

    publish("begin", core.begin())
    left = 40  # deliveries between the last tick and the deaths
    while not core.finished and left:
        delivered = links.deliver()
        if delivered is None:
            assert core.in_flight, f"silent for ever at tick {core.tick}"
            for number in core.in_flight:
                publish("overdue", core.overdue(number))
            continue
        who, message, answers = delivered
        if who == "coordinator":
            publish(type(message).__name__, answers)
        else:
            send([wire.decode(m.key, wire.encode(m)) for m in answers])
        left -= until is not None and core.tick >= until
    source.close()
    return driven


def _join(
    links: _Links,
    options: RunOptions,
    core: Coordinator,
    source: Source,
    past: ResumePoint | None,
) -> None:
    world = World(source, options.body, past)

    def answer(message: wire.Message) -> Messages:
        decision = world.receive(message)
        if decision is None:
            return []
        return [world.answer(decision) or wire.Leave("world")]

    def conduct(message: wire.Message) -> Messages:
        stops = isinstance(message, wire.Leave)
        return core.stop() if stops else core.receive(message)

    links.join("world", world.topics, answer)
    for number, who in enumerate(options.host_names()):
        host, keys = _host(options, number)
        links.join(who, keys, lambda message, host=host: host.receive([message]))  # type: ignore[misc]
    links.join("coordinator", wire.COORDINATOR_KEYS, conduct)


def _host(options: RunOptions, number: int) -> tuple[Cell | Worker, tuple[str, ...]]:
    if not (workers := options.sharing):
        return Cell(number), wire.cell_keys(number)
    learning = options.new_worker_learning(number)
    hosted = shares(len(options.sensors), workers)
    keys = wire.worker_keys(number, learns=learning is not None)
    return Worker(number, hosted, learning), keys


def record(
    driven: Driven,
    options: RunOptions,
    log: Path,
    past: ResumePoint | None = None,
    split: int = 0,
) -> None:
    """Write what was published, so and so long after another, as a recorder would.

    Of a run that did not end, each part's next message is missing.
    """
    facts = {**describe(options), "swarm": "golden"}
    sent = {} if past is None else dict(past.counts)
    time = 10**18 + sum(sent.values()) * BETWEEN
    messages = list(driven.published)
    ended = driven.core.finished
    parts = ["coordinator", "world", *options.host_names()]
    if ended:
        left = {message.who for message in messages if isinstance(message, wire.Leave)}
        messages += [wire.Leave(who) for who in parts if who not in left]
    writer = SplitWriter(log, facts, past, split=Split(split) if split else None)
    for message in messages:
        number = sent.get(message.sender, 0)
        sent[message.sender] = number + 1
        time += BETWEEN
        payload = wire.encode(message)
        writer.add(wire.Delivery(message.key, number, time, payload), time)
        if split and number % 8 == 0:  # what has no end yet is no file's size
            writer.flush(time)
    writer.finish({}, {who: sent.get(who, 0) + (not ended) for who in parts})
