"""Sensor faults of limited duration, injected into known walks.

The first half of a walk is as it is. In the second half, time is cut into spells; each
has one fault somewhere in it, that lasts one step, a fiftieth of a spell or a fifth.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.dual.realization import inclusions
from neurosnap.poc.order.graph import PocGraph
from tools.paper.walks import follow, world_of

Fault: TypeAlias = Literal["none", "stuck off", "stuck on", "flipped", "swapped"]
"""What goes wrong: nothing; a sensor reads 0, 1, or the opposite of what it should; two
sensors read what the other should."""

FAULTS: tuple[Fault, ...] = get_args(Fault)

_SPELLS = 8
_LENGTHS = (1 / 5, 1 / 50, 0)


PLACES = {
    "path": ("neurosnap/Path-v0", None),
    "cycle": ("neurosnap/Cycle-v0", None),
    "grid": ("neurosnap/Grid-v0", None),
    "waiting": ("neurosnap/Rail-v0", None),
    "target": ("neurosnap/Path-v0", "drawn"),
}
"""The worlds that are walked through, by id and target.

Their order goes into the seed of every walk: add last.
"""


@dataclass(frozen=True)
class Course:
    """The readings of a random walk, and the order that holds on every walk."""

    bits: NDArray[np.bool_]
    """``(steps, N)``: what the sensors should read."""
    truth: PocGraph
    """``a <= b`` iff in no transition ``a`` is on and ``b`` is not."""


@dataclass(frozen=True)
class Episode:
    """A fault: which sensors it affects, and when it begins and ends."""

    first: int
    end: int
    sensors: tuple[int, ...]


def course(name: str, seed: int, run: int, steps: int) -> Course:
    """Return a walk that draws its actions uniformly; waiting and target included.

    Args:
        name: One of `PLACES`.
        seed: From 0 up.
        run: From 0 up; with the seed it says all.
        steps: Observations, at least 1.
    """
    key = (list(PLACES).index(name), run, 2)  # not the streams of walks and tasks
    of_world, of_moves = np.random.SeedSequence(seed, spawn_key=key).spawn(2)
    world_name, target = PLACES[name]
    world = world_of(world_name, int(of_world.generate_state(1)[0]), target)
    moves = world.moves
    draws = np.random.default_rng(of_moves).integers(len(moves), size=steps - 1)
    after = follow(moves, world.place, draws)
    before = np.append(after[:1], after[:-1])  # the first step is none
    every = np.arange(moves.shape[1])
    # What may be sensed: after any transition, and where a walk begins.
    ends = np.append(moves.ravel(), every)
    starts = np.append(np.tile(every, len(moves)), every)
    order = inclusions(world.sense(ends, starts))
    return Course(world.sense(after, before).T, PocGraph(order))


def faults(fault: Fault, sensors: int, steps: int, seed: int) -> list[Episode]:
    """Return when which sensors fail: one episode a spell, none of them overlap.

    Args:
        fault: What kind; none has no episodes.
        sensors: ``N``, at least 2.
        steps: How many there are.
        seed: Draws sensors, starts and lengths.
    """
    if fault == "none":
        return []
    generator = np.random.default_rng(seed)
    spell = steps // (2 * _SPELLS)
    episodes = []
    for begin in range(steps - _SPELLS * spell, steps, spell) if spell else ():
        length = max(1, int(spell * _LENGTHS[generator.integers(len(_LENGTHS))]))
        first = begin + int(generator.integers(spell - length + 1))
        failing = generator.permutation(sensors)[: 2 if fault == "swapped" else 1]
        episodes.append(Episode(first, first + length, tuple(failing.tolist())))
    return episodes


def seen(
    bits: NDArray[np.bool_], fault: Fault, episodes: list[Episode]
) -> NDArray[np.bool_]:
    """Return what sensors read while some of them fail: ``(steps, N)``, a new array."""
    read = bits.copy()
    for episode in episodes:
        during, which = slice(episode.first, episode.end), list(episode.sensors)
        match fault:
            case "none":
                pass
            case "stuck off" | "stuck on":
                read[during, which] = fault == "stuck on"
            case "flipped":
                read[during, which] = ~bits[during, which]
            case "swapped":
                read[during, which] = bits[during, which[::-1]]
    return read
