"""One incarnation of a simulated swarm: from its start to its end or a crash.

The cores are the real ones, and so is the recorder's writer; only their shells, which
wait for messages and clocks, are replaced. What a clock would bring about (a wave's
deadline, a death that is noticed, a chunk that is written) is an event of the schedule,
and every event is drawn from one generator.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations, product
from typing import TYPE_CHECKING

from neurosnap import wire
from neurosnap.errors import AnswerLostError, MessageError, SwarmError
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_shares import shares
from neurosnap.protocol.world import World
from neurosnap.recording.format.completeness import Completeness
from neurosnap.runtime.parts import coordinator_process
from neurosnap.runtime.parts.job import decoded
from neurosnap.sources.protocol import Source
from tests.support.simulated_intake import Intake
from tools.simulate.check import WrongError
from tools.simulate.disk import Disk
from tools.simulate.recorder import Recorder
from tools.simulate.simulated_faults import Case
from tools.simulate.simulated_hub import Faults, SimulatedHub
from tools.simulate.source import source_of

if TYPE_CHECKING:
    from neurosnap.fabric.in_memory import MemoryFabric

Transition = Callable[[wire.Message], list[wire.Message]]

Link = tuple[tuple[str, str], ...]
"""All pairs of parts that lose each other when it is cut: the far one is second."""

_OTHER = "a hub that is not the recorder's"
_AGAIN = "/again"
_MOST = 200_000  # deliveries in one life; more, and it does not end


class Life:
    """One life of a swarm.

    Args:
        case: The run; its recording must not exist yet.
        past: Where it goes on from, if it does.
        disk: What it is recorded on.
        intake: Where readings come from, if from outside.
    """

    def __init__(
        self, case: Case, past: ResumePoint | None, disk: Disk, intake: Intake | None
    ) -> None:
        self._options = options = case.options
        self._past = past
        self._disk, self._intake = disk, intake
        self._weather = weather = case.weather
        self._chance = chance = case.chance
        self._tally = case.tally
        self._hosts = options.host_names()
        self._parts = ("coordinator", "world", *self._hosts)
        # The recorder is at the first hub.
        self._at = {who: chance.randrange(weather.hubs) for who in self._parts}
        self._at["recorder"] = 0
        self._links, self._hub_links = self._breakable()
        self._hub = SimulatedHub(chance.getrandbits(32), self._faults())
        self._ends: dict[str, MemoryFabric] = {}
        self._gone: set[str] = set()
        self._cut: list[Link] = []
        self._known_lost = 0
        self._dead: list[str] = []
        self._twin = ""  # the part that is there twice
        self._core = coordinator_process.coordinator_for(options, past)
        chunk = chance.choice([100, 1000])
        self._recorder = Recorder(case, past, self._parts, chunk, disk)

    def _breakable(self) -> tuple[list[Link], list[Link]]:
        """Return what may be cut between two parts, and between two hubs."""
        parts = (*self._parts, "recorder") if self._weather.deaf else self._parts
        hubs = [between(hub, self._at, parts) for hub in range(1, self._weather.hubs)]
        return [(pair,) for pair in combinations(parts, 2)], list(filter(None, hubs))

    def _faults(self) -> Faults:
        weather, chance = self._weather, self._chance
        pair = ("coordinator", "world")
        # Only waves and questions have deadlines: only what they are made of may be
        # dropped.
        spared = {pair, pair[::-1], *((who, "recorder") for who in self._parts)}
        late = [who for who in self._parts if chance.random() < weather.slow]
        slow = set(product(self._parts, late))
        for hub in range(1, weather.hubs):
            if chance.random() < weather.slow:
                for pair in between(hub, self._at, tuple(self._at)):
                    slow |= {pair, pair[::-1]}
        return Faults(
            weather.duplicate, weather.drop, frozenset(spared), frozenset(slow)
        )

    def live(self) -> tuple[Completeness, dict[str, int]]:
        """Live; return what the recording says of itself, and what each part sent.

        Raises:
            SwarmError: Somebody died, a wave was lost for good, or nobody has anything
                left to say. What was recorded by then is in the file.
            WrongError: The recording lacks what nobody took.
        """
        source = self._intake or source_of(self._options)
        try:
            self._join(source)
            self._run()
            completeness = self._recorder.finish()
        except SwarmError:
            self._break_off()
            raise
        finally:
            self._tally.losses += self._hub.lost.total()
            deaf = any(receiver == "recorder" for _, receiver in self._hub.lost)
            self._tally.deaf += deaf
            source.close()
            self._recorder.close()
        # What was lost in another life stays missing, and so does what a flipped bit
        # took of the recording that this one went on from, or who cut it short.
        tally = self._tally
        taken = tally.deaf or tally.flips or tally.truncated or tally.twice
        if completeness.missing and not taken:
            raise WrongError(f"recording: must be whole, lacks {completeness.missing}")
        return completeness, {who: self._ends[who].sent for who in self._parts}

    # Parts ---------------------------------------------------------------------------

    def _join(self, source: Source | Intake) -> None:
        tick = self._past.tick if self._past else 0
        known = self._intake.resume_after(tick) if self._intake else None
        world = World(source, self._options.body, self._past, known)

        def answer(message: wire.Message) -> list[wire.Message]:
            try:
                decision = world.receive(message)
            except MessageError as error:
                return [wire.Fault("world", str(error))]
            if decision is None:
                return []
            return [world.answer(decision) or wire.Leave("world")]

        self._listen("world", world.topics, answer)
        for number, who in enumerate(self._hosts):
            self._host(number, who)
        if self._chance.random() < self._weather.twice:
            self._tally.twice += 1
            self._twin = self._chance.choice(self._hosts)
            self._host(self._hosts.index(self._twin), f"{self._twin}{_AGAIN}")
        self._listen("coordinator", wire.COORDINATOR_KEYS, self._conduct)
        self._hub.fabric("recorder").listen(("**",), self._recorder.hear)

    def _host(self, number: int, who: str) -> None:
        """Let a cell or a worker take part."""
        workers = self._options.sharing
        if workers:
            hosted = shares(len(self._options.sensors), workers)
            learning = self._options.new_worker_learning(number)
            core: Cell | Worker = Worker(number, hosted, learning)
            keys = wire.worker_keys(number, learns=learning is not None)
        else:
            core, keys = Cell(number), wire.cell_keys(number)
        self._listen(who, keys, lambda message: core.receive([message]))

    def _listen(self, who: str, topics: Sequence[str], core: Transition) -> None:
        """Publish what `core` says to each message that comes; go after a last word."""
        name = who.removesuffix(_AGAIN)
        first = 0 if self._past is None else self._past.counts.get(name, 0)
        end = self._ends[who] = self._hub.fabric(who, first=first)

        def handle(deliveries: list[wire.Delivery]) -> None:
            for message in decoded(end, deliveries):
                said = core(message)
                end.publish(*said)
                if wire.Leave(who) in said:
                    self._go(who)

        end.listen(topics, handle)

    def _conduct(self, message: wire.Message) -> list[wire.Message]:
        if isinstance(message, wire.Leave):
            return self._core.stop()
        return self._core.receive(message)

    def _say(self, *messages: wire.Message) -> None:
        self._ends["coordinator"].publish(*messages)

    def _go(self, who: str) -> None:
        self._gone.add(who)
        self._hub.leave(who)

    # What happens --------------------------------------------------------------------

    def _run(self) -> None:
        self._say(*self._core.begin())
        for _ in range(_MOST):
            if self._core.finished:
                return self._end_in_order()
            if self._hub.step():
                self._tally.deliveries += 1
                self._disturb()
            else:
                self._silence()
        raise RuntimeError(f"life: must end within {_MOST} deliveries")

    def _disturb(self) -> None:
        """Let happen what may after any delivery."""
        weather, chance = self._weather, self._chance
        if chance.random() < weather.cut:
            parting = bool(self._hub_links) and chance.random() < 0.5
            link = chance.choice(self._hub_links if parting else self._links)
            self._part(link)
            self._cut.append(link)
            self._tally.cuts += 1
            self._tally.parted += parting
        if self._cut and chance.random() < weather.heal:
            self._heal(self._cut[0])
        if chance.random() < weather.anew:
            self._tally.anew += 1
            for ((one, other),) in self._links:
                self._hub.cut(one, other)
                self._hub.heal(one, other)
            self._cut = []
        if chance.random() < weather.late and self._core.in_flight:
            self._deadline(chance.choice(self._core.in_flight))
        self._maybe_crash()

    def _part(self, link: Link) -> None:
        for pair in link:
            self._hub.cut(*pair)

    def _heal(self, link: Link) -> None:
        self._cut = [other for other in self._cut if other != link]
        still = {pair for other in self._cut for pair in other}
        for pair in link:
            if pair not in still:
                self._hub.heal(*pair)
        self._tally.healed += 1

    def _silence(self) -> None:
        """Nothing is under way: a wave is late, or all is lost.

        Raises:
            SwarmError: All is lost.
            WrongError: A wave is late, and nothing was lost since all were sent again.
        """
        lost = self._hub.lost.total()
        if self._core.in_flight and lost == self._known_lost and not self._twin:
            raise WrongError(f"waves: must settle, got {self._core.in_flight} late")
        self._known_lost = lost
        for link in dict.fromkeys(self._cut):
            if self._chance.random() < 0.5:
                self._heal(link)
        for number in self._core.in_flight:
            self._deadline(number)
        if not self._hub.pending and not self._core.finished:
            self._tally.stalled += 1
            raise SwarmError("world: must stay until the run ends, is gone")

    def _deadline(self, number: int) -> None:
        """Let a wave be late, or a question: `number` is as in `in_flight`."""
        try:
            self._say(*self._core.overdue(number))
        except AnswerLostError as error:
            self._tally.given_up += 1
            self._say(wire.Fault("coordinator", str(error)), wire.Leave("coordinator"))
            raise
        self._tally.repeats += 1

    def _maybe_crash(self) -> None:
        """Let one or two parts or hubs die, and the others go on until it is noticed.

        Raises:
            SwarmError: It is noticed.
        """
        chance = self._chance
        if chance.random() >= self._weather.crash:
            return
        mortal = ["hub", "recorder", "coordinator", "world", self._hosts[0]]
        mortal += [_OTHER] * bool(self._hub_links)
        for who in chance.sample(mortal, chance.choice([1, 1, 2])):
            if who == _OTHER:
                self._lose_hub()
                continue
            kin = self._hosts if who == self._hosts[0] else [who]
            self._dead.append(victim := chance.choice(kin))
            self._tally.crashes += 1
            self._hub.leave(victim)
        if "hub" not in self._dead:
            for _ in range(chance.choice([0, 1, 10, 100])):
                self._tally.deliveries += self._hub.step()
        raise SwarmError(f"{self._dead[0]}: must not end before it is asked to")

    def _lose_hub(self) -> None:
        """Let one die that is not the recorder's, and with it the parts behind it."""
        link = self._chance.choice(self._hub_links)
        self._part(link)
        for who in dict.fromkeys(far for _, far in link):
            self._dead.append(who)
            self._hub.leave(who)
        self._tally.crashes += 1
        self._tally.hubs_lost += 1

    # How it ends ---------------------------------------------------------------------

    def _end_in_order(self) -> None:
        """Let everybody leave, the recorder last.

        Raises:
            SwarmError: Somebody dies on the way out.
        """
        self._bid_farewell("coordinator")
        for _ in range(self._chance.choice([0, 1, 10, 100])):
            if self._hub.step():
                self._tally.deliveries += 1
                self._maybe_crash()
        for who in self._parts:
            self._bid_farewell(who)
        while self._hub.step():
            self._tally.deliveries += 1
            self._maybe_crash()

    def _bid_farewell(self, who: str) -> None:
        """Let a part leave, unless it has."""
        if who not in self._gone:
            self._ends[who].publish(wire.Leave(who))
            self._go(who)

    def _break_off(self) -> None:
        """Leave the file as the recorder leaves it when somebody died.

        It writes down what there is, unless it died itself, or the hub did: then the
        file has what was on the disk.
        """
        for who in (*self._parts, f"{self._twin}{_AGAIN}"):
            self._hub.leave(who)
        if self._recorder.failed:
            return
        if {"hub", "recorder"}.isdisjoint(self._dead):
            while self._hub.step():
                self._tally.deliveries += 1
            self._recorder.finish()
        else:
            self._recorder.close()
            self._disk.lose()


def between(hub: int, at: Mapping[str, int], parts: Sequence[str]) -> Link:
    """Return the link in front of a hub.

    Args:
        hub: Its place in the line, from 1.
        at: The place of each part's hub.
        parts: Those that count.
    """
    near = [who for who in parts if at[who] < hub]
    far = [who for who in parts if at[who] >= hub]
    return tuple((one, other) for one in near for other in far)
