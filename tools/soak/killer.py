"""Who kills parts of a running swarm, and notes what each killing costs."""

import asyncio
import random
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import combinations, islice
from typing import TypeAlias

import msgspec
import numpy as np
import psutil

from neurosnap.runtime.registry import parts_of

Victims: TypeAlias = tuple[str, ...]


class Killing(msgspec.Struct, kw_only=True):
    """One killing, and what it cost."""

    victims: Victims
    restarts: int = 0
    """Until the next killing."""
    redone: int = 0
    """Ticks that were whole but not on disk; they were done again."""
    ms: float = 0.0
    """How long they had taken at first. Progress is told twenty times a second, so up
    to 50 ms are missing here, and their ticks in `redone`."""


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
        pause: Seconds a life of the swarm may last at most before somebody is killed.
        clock: Seconds that only grow.
    """

    def __init__(
        self,
        roles: Sequence[str],
        kills: int,
        seed: int,
        pause: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.killings: list[Killing] = []
        self.restarts = 0
        self._roles = roles
        self._kills = kills
        self._pause = pause
        self._clock = clock
        self._chance = random.Random(seed)
        self._under_way = asyncio.Event()
        self._struck = False  # what comes from a life that is over is no sign of life
        self._from = 0  # the tick that this life goes on from
        self._reached: list[tuple[int, float]] = []  # ticks of this life, and when

    def follow(self, tick: int) -> None:
        """Take in how far the run is: it is under way once it moves."""
        if tick > self._from:
            self._reached.append((tick, self._clock()))
            if not self._struck:
                self._under_way.set()

    def restarted(self, tick: int, redone: int) -> None:
        """Take in that another life of the swarm goes on from a tick."""
        self.restarts += 1
        if self.killings:
            killing = self.killings[-1]
            killing.restarts += 1
            killing.redone += redone
            killing.ms += self._ms_since(tick)
        self._from = tick
        self._reached.clear()
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
            self.killings.append(Killing(victims=victims))
            self._under_way.clear()
            self._struck = True
        await self._under_way.wait()

    def _ms_since(self, tick: int) -> float:
        if not self._reached:
            return 0.0
        ticks, times = zip(*self._reached, strict=True)
        return float(1000 * (times[-1] - np.interp(tick, ticks, times)))

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


def summary(killings: Sequence[Killing]) -> Iterator[str]:
    """Yield a line for each kind of victims: how often, and what that cost."""
    yield f"{'killed':24} times  ticks redone: mean, most     ms: mean, most"
    kinds = sorted({killing.victims for killing in killings}, key=lambda v: (len(v), v))
    for victims in kinds:
        of_kind = [killing for killing in killings if killing.victims == victims]
        ticks = np.array([killing.redone for killing in of_kind])
        ms = np.array([killing.ms for killing in of_kind])
        yield (
            f"{'+'.join(victims):24} {len(of_kind):5}"
            f" {ticks.mean():19.1f} {ticks.max():6}"
            f" {ms.mean():12.0f} {ms.max():6.0f}"
        )
