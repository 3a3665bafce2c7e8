"""Kills parts of a running swarm, and counts the ticks lost."""

import asyncio
import random
import signal
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import combinations, islice
from typing import TypeAlias

import psutil

from tests.support.swarm_processes import parts_of

Victims: TypeAlias = tuple[str, ...]


def deck(roles: Sequence[str], chance: random.Random) -> Iterator[Victims]:
    """Yield every role and every pair of roles in random order, again and again."""
    cards = [*combinations(roles, 1), *combinations(roles, 2)]
    while True:
        yield from chance.sample(cards, len(cards))


class Killer:
    """Kills, waits until the swarm is under way again, kills the next.

    Args:
        roles: Kinds of parts; of several of a kind any one is killed.
        kills: How many times it kills.
        seed: Draws whom to kill, and when.
        pause: Seconds a life of the swarm may last at most before a part is killed.
    """

    def __init__(
        self, roles: Sequence[str], kills: int, seed: int, pause: float
    ) -> None:
        self.killed: Counter[str] = Counter()
        """How often each role, and each pair, was."""
        self.restarts = 0
        self.redone = 0
        """Ticks that were whole but not on disk; they were done again."""
        self.rest = 0.0
        """Seconds that the run goes on for after the last kill."""
        self._roles = roles
        self._kills = kills
        self._pause = pause
        self._chance = random.Random(seed)
        self._under_way = asyncio.Event()
        self._struck = False  # what comes from a life that is over is no sign of life
        self._from = 0  # the tick that this life goes on from

    def follow(self, tick: int) -> None:
        """Take in how far the run is: it is under way once it moves."""
        if tick > self._from and not self._struck:
            self._under_way.set()

    def restarted(self, tick: int, redone: int) -> None:
        """Take in that another life of the swarm goes on from a tick."""
        self.restarts += 1
        self.redone += redone
        self._from = tick
        self._under_way.clear()
        self._struck = False

    async def hunt(self, launcher: psutil.Process) -> None:
        """Kill parts of a launcher; return once its run has gone on after the last."""
        for victims in islice(deck(self._roles, self._chance), self._kills):
            killed = False
            while not killed:
                await self._under_way.wait()
                await asyncio.sleep(self._chance.uniform(0.0, self._pause))
                killed = self._under_way.is_set() and self._kill(launcher, victims)
            self.killed["+".join(victims)] += 1
            self._under_way.clear()
            self._struck = True
        await self._under_way.wait()
        await asyncio.sleep(self.rest)

    def _kill(self, launcher: psutil.Process, victims: Victims) -> bool:
        parts: dict[str, list[psutil.Process]] = {}
        for who, process in parts_of(launcher):
            parts.setdefault(who.partition("/")[0], []).append(process)
        if not set(self._roles) <= parts.keys():
            return False  # it is coming up, or going down
        for process in [self._chance.choice(parts[role]) for role in victims]:
            with suppress(psutil.NoSuchProcess):
                process.send_signal(signal.SIGKILL)
        return True
