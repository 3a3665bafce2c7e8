"""The coordinator's side of learning that is spread over workers.

Pure: what is to be learned in, a message out; what the workers learned in, and once the
last of it has come, all of it, in an order that does not depend on when it came.
"""

from collections.abc import Sequence
from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.ask_until_answered import Round
from neurosnap.protocol.worker_edges import ints

Pairs: TypeAlias = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.uint8]]
"""``(C,)`` each: the latter sensors of pairs, the former ones, and their codes."""
_CODES = np.array([0, 1, 2, 3, 4, 8, 12], np.uint8)


class LearnControl:
    """Tells the workers what to learn, and joins the changes they report.

    Args:
        shares: The sensors of each worker, whose pairs with those before them it has.
        repeats: How often workers that do not answer are told again.

    Attributes:
        shares: As given.
        under_way: What is not learned by all yet; None if there is nothing.
        begins: The size of the snapshot of the key-frame that they go on from; 0 once
            they have learned something.
        passed_on: What else they have to hear until then.
        changes: The last decision, if a sensor came or went with it that some may not
            have heard of.
    """

    def __init__(self, shares: Sequence[range], repeats: int) -> None:
        self.begins = 0
        self.passed_on: list[wire.Band] = []
        self.changes: tuple[wire.Decision, ...] = ()
        self.shares = shares
        self._repeats = repeats
        self.under_way: wire.Learn | None = None
        self._last = wire.Learn(0)  # what was last
        self._round: Round[bool] = Round("", repeats)
        self._parts: list[set[int]] = []  # that have come, by worker
        self._sizes: list[int] = []  # how many there are, by worker; 0: not known yet
        self._weighed: list[wire.WeighedLink] = []  # what spoke for what

    def ask(self, learn: wire.Learn) -> list[wire.Message]:
        """Return the message that tells the workers what to learn."""
        self.under_way = self._last = learn
        workers = (f"worker/{worker}" for worker in range(len(self.shares)))
        self._round = Round(f"learn (tick {learn.tick})", self._repeats, workers)
        self._parts = [set() for _ in self.shares]
        self._sizes = [0] * len(self.shares)
        self._weighed = []
        return [learn]

    def ask_to_learn(
        self, observation: wire.Observation, anomaly: wire.Anomaly | None
    ) -> list[wire.Message]:
        """Return what tells the workers to learn; first they weigh what is broken."""
        links = () if anomaly is None else anomaly.links
        pairs = dict.fromkeys((link.source, link.target) for link in links)
        # None weighs what is of one sensor.
        weighed = [(a, b) for a, b in pairs if a >> 1 != b >> 1]
        return self.ask(
            wire.Learn(
                tick=observation.tick,
                bits=observation.bits,
                known=observation.known,
                begins=self.begins,
                sources=tuple(a for a, _ in weighed),
                targets=tuple(b for _, b in weighed),
                changes=self.changes,
            )
        )

    def ask_bands(self, tick: int) -> list[wire.Message]:
        """Return the message that makes them send the bands of a key-frame.

        They answer behind these, with what they learned last, at the same tick.
        """
        last = self._last if self._last.tick == tick else wire.Learn(tick)
        begins, changes = self.begins, self.changes
        replace = msgspec.structs.replace
        return self.ask(replace(last, frame=tick, begins=begins, changes=changes))

    def forget(self) -> None:
        """Reset: no request is under way, and nothing was learned last."""
        self.under_way, self._last, self.changes = None, wire.Learn(0), ()

    def repeat(self) -> list[wire.Message]:
        """Tell them again.

        Raises:
            AnswerLostError: They were told as often as allowed; it names the
                silent ones.
        """
        if self.under_way is None:
            return []
        self._round.ask_again(self._round.silent)
        return [*self.passed_on, self.under_way]

    def receive(self, learned: wire.Learned) -> Pairs | None:
        """Receive what a worker learned; nothing is under way once all have.

        Returns:
            As `pairs_in`. No two messages are of the same pairs, so it does not matter
            in which order they came. None if it came before, or was given up.

        Raises:
            MessageError: It cannot be right.
        """
        learn, here = self.under_way, (learned.tick, learned.frame)
        if learn is None or here < (learn.tick, learn.frame):
            return None
        pairs = self._check(learned, learn)
        parts = self._parts[learned.worker]
        if learned.part in parts:
            return None
        parts.add(learned.part)
        self._sizes[learned.worker] = learned.parts
        self._weighed += learned.links
        if learned.parts == len(parts):
            self._round.answers[learned.sender] = True
        if not self._round.silent:
            self.under_way = None
            self.begins, self.passed_on, self.changes = 0, [], ()
        return pairs

    def weighed(self, anomaly: wire.Anomaly) -> wire.Anomaly:
        """Return an anomaly with what the workers say spoke for what it broke."""
        found = {(link.source, link.target): link for link in self._weighed}
        links = []
        for link in anomaly.links:
            if said := found.get((link.source, link.target)):
                weights = {"support": said.support, "against": said.against}
                link = msgspec.structs.replace(link, **weights, since=said.since)
            links.append(link)
        return msgspec.structs.replace(anomaly, links=tuple(links))

    def _check(self, learned: wire.Learned, learn: wire.Learn) -> Pairs:
        """Return what a message says changed; refuse what cannot be right."""
        if (learned.tick, learned.frame) != (learn.tick, learn.frame):
            rule = f"must be of tick {learn.tick}, key-frame {learn.frame}"
            got = f"tick {learned.tick}, key-frame {learned.frame}"
            raise MessageError(f"learned: {rule}, got {got}")
        if learned.worker >= len(self.shares):
            rule = f"must be one of {len(self.shares)} workers"
            raise MessageError(f"learned: {rule}, got worker {learned.worker}")
        share = self.shares[learned.worker]
        size = self._sizes[learned.worker] or learned.parts
        if learned.parts != size or learned.part >= size:
            got = f"{learned.part} of {learned.parts}"
            raise MessageError(f"learned: part must be one of {size}, got {got}")
        pairs = pairs_in(learned, share)
        asked = zip(learn.sources, learn.targets, strict=True)
        own = [(k, *pair) for k, pair in enumerate(asked) if max(pair) >> 1 in share]
        expected = own if learned.part == learned.parts - 1 else []
        links = [(one.number, one.source, one.target) for one in learned.links]
        if links != expected:
            rule = f"must be of {len(expected)} implications"
            raise MessageError(f"learned: links {rule}, got {links[:10]}")
        if not all(
            np.isfinite((one.support, one.against)).all() for one in learned.links
        ):
            raise MessageError("learned: support must be finite, got one that is not")
        return pairs


def pairs_in(message: wire.Learned, share: range) -> Pairs:
    """Return what the message of a worker with a share of the pairs says changed.

    Raises:
        MessageError: It cannot be right.
    """
    latter = ints("learned: latter", message.latter).astype(np.intp)
    former = ints("learned: former", message.former).astype(np.intp)
    codes = np.frombuffer(message.codes, np.uint8)
    if not len(latter) == len(former) == len(codes):
        got = f"{len(latter)}, {len(former)} and {len(codes)}"
        raise MessageError(f"learned: must have as many former as latter, got {got}")
    beyond = (latter < share.start) | (latter >= share.stop)
    if beyond.any():
        rule = f"must be in {share.start} to {share.stop - 1}"
        raise MessageError(f"learned: latter {rule}, got {latter[beyond][0]}")
    if ((former < 0) | (former >= latter)).any():
        raise MessageError("learned: former must be before latter, got one that is not")
    if not np.isin(codes, _CODES).all():
        raise MessageError("learned: codes must be of pairs, got one that is not")
    return latter, former, codes
