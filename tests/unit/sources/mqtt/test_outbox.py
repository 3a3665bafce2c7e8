"""The queue of unsent messages is bounded and ordered, and drops stale ones."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from neurosnap.sources.mqtt.outbox import LASTS, TOGETHER, WAITING, Outbox, Outgoing


def passing(number: int, topic: str = "act") -> Outgoing:
    return Outgoing(topic, b"%d" % number)


def drained(outbox: Outbox, now: float) -> list[Outgoing]:
    """Everything, batch by batch."""
    everything: list[Outgoing] = []
    while batch := outbox.batch(now):
        everything += batch
        for message in batch:
            outbox.sent(message)
    return everything


def test_what_to_do_is_not_done_too_late() -> None:
    outbox = Outbox()
    outbox.send(passing(1), 0.0)
    outbox.send(passing(2), 1.0)
    assert drained(outbox, LASTS) == [passing(2)]
    assert outbox.dropped == 1


@given(count=st.integers(0, 2 * WAITING))
def test_of_too_much_to_do_the_latest_is_kept_in_order(count: int) -> None:
    outbox = Outbox()
    for number in range(count):
        outbox.send(passing(number), 0.0)
    kept = range(max(0, count - WAITING), count)
    assert drained(outbox, 0.0) == [passing(number) for number in kept]
    assert outbox.dropped == count - len(kept)


class Broker(RuleBasedStateMachine):
    """Whatever happens in between, each topic ends up saying what it should."""

    def __init__(self) -> None:
        super().__init__()
        self.outbox = Outbox()
        self.wanted: dict[str, bytes] = {}
        self.retained: dict[str, bytes] = {}
        self.sent: list[Outgoing] = []
        self.got: list[Outgoing] = []
        self.on_its_way: list[Outgoing] = []

    @rule(topic=st.sampled_from("abcdefghijklmnopqrst"), payload=st.binary(max_size=1))
    def hold(self, topic: str, payload: bytes) -> None:
        is_new = self.wanted.get(topic) != payload
        assert self.outbox.hold(topic, payload) is is_new
        self.wanted[topic] = payload

    @rule(topic=st.sampled_from(["x", "y"]))
    def send(self, topic: str) -> None:
        message = passing(len(self.sent), topic)
        self.outbox.send(message, 0.0)
        self.sent.append(message)

    @rule()
    def begin(self) -> None:
        if not self.on_its_way:
            self.on_its_way = self.outbox.batch(0.0)

    @rule(place=st.integers(0, TOGETHER - 1))
    def arrive(self, place: int) -> None:
        """One of those on their way, in any order."""
        if place >= len(self.on_its_way):
            return
        message = self.on_its_way.pop(place)
        if message.retain:
            self.retained[message.topic] = message.payload
        else:
            self.got.append(message)
        self.outbox.sent(message)

    @rule()
    def break_off(self) -> None:
        self.on_its_way = []
        self.retained = {}
        self.outbox.renew()

    @invariant()
    def no_batch_is_large_or_has_a_topic_twice(self) -> None:
        topics = [message.topic for message in self.outbox.batch(0.0)]
        assert len(topics) == len(set(topics)) <= TOGETHER

    def teardown(self) -> None:
        self.break_off()
        while self.outbox.batch(0.0):
            self.begin()
            while self.on_its_way:
                self.arrive(0)
        assert self.retained == self.wanted
        for topic in ("x", "y"):
            sent = [message for message in self.sent if message.topic == topic]
            assert [message for message in self.got if message.topic == topic] == sent


TestBroker = Broker.TestCase
