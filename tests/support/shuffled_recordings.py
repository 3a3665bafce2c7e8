"""Messages of a recording in another order that keeps each sender's own."""

import random
from collections.abc import Iterable

from neurosnap.recording.read.chunk_messages import Recorded
from tests.support.rewritten_recordings import Change


def by_sender(recorded: Iterable[Recorded]) -> dict[str, list[Recorded]]:
    queues: dict[str, list[Recorded]] = {}
    for each in recorded:
        queues.setdefault(each.message.sender, []).append(each)
    return queues


def shuffled(seed: int) -> Change:
    """Return the change that keeps only each sender's own order."""

    def change(recorded: list[Recorded]) -> Iterable[Recorded]:
        queues = [iter(queue) for queue in by_sender(recorded).values()]
        chance = random.Random(seed)
        while queues:
            queue = chance.choice(queues)
            following = next(queue, None)
            if following is None:
                queues.remove(queue)
            else:
                yield following

    return change
