"""The faults that may happen to a simulated swarm, and those that happened."""

import random
from pathlib import Path

import msgspec

from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.write.rotation import Split

DECADES = 1e9
"""Seconds that a clock jumps by."""


class Weather(msgspec.Struct, frozen=True, kw_only=True):
    """The probability of each simulated fault; per delivery unless stated otherwise."""

    hubs: int = 1
    """How many there are, linked in a line; the parts are spread over them."""
    duplicate: float = 0.0
    drop: float = 0.0
    slow: float = 0.0
    """That a part gets its messages late, by part; that a link between hubs does."""
    cut: float = 0.0
    """That a link between two parts is cut, or between two hubs."""
    heal: float = 0.0
    """That a link which is cut is healed; where all is silent, a half."""
    deaf: bool = False
    """Whether links to the recorder are cut as well."""
    late: float = 0.0
    """That a wave's deadline passes although nothing of it is lost."""
    crash: float = 0.0
    """That a part dies."""
    flip: float = 0.0
    """That a bit of the recording flips, by life."""
    vanish: float = 0.0
    """That a file of it is taken away, by life."""
    power: float = 0.0
    """That a death of the recorder is a power cut, by death."""
    begun: float = 0.0
    """That it leaves a last file of several that has only begun, by death."""
    full: float = 0.0
    """That the disk is full, by message."""
    truncate: float = 0.0
    """That another program cuts its file short, by message."""
    twice: float = 0.0
    """That a cell or worker joins twice, by life."""
    gap: float = 0.0
    """That the intake dies and comes again, by reading; half of the files come in."""
    jump: float = 0.0
    """That the clock jumps by decades, by message and by reading."""
    anew: float = 0.0
    """That the hub is started anew: what is under way is lost, and all come back."""


class Tally(msgspec.Struct):
    """Counts of what happened in the simulated runs: faults, restarts, ticks."""

    schedules: int = 0
    ticks: int = 0
    births: int = 0
    """Sensors that were grown."""
    files: int = 0
    """Files of the recordings in the end."""
    deliveries: int = 0
    crashes: int = 0
    hubs_lost: int = 0
    """Crashes of a hub that cost only the parts behind it."""
    restarts: int = 0
    cuts: int = 0
    parted: int = 0
    """Cuts between hubs."""
    healed: int = 0
    losses: int = 0
    deaf: int = 0
    """Lives in which some of them were the recorder's."""
    repeats: int = 0
    given_up: int = 0
    """Lives that ended because a wave was lost for good."""
    stalled: int = 0
    """Lives that ended because the world and the coordinator lost each other."""
    flips: int = 0
    vanished: int = 0
    powercuts: int = 0
    full: int = 0
    truncated: int = 0
    twice: int = 0
    """Lives with a part that joined twice."""
    gaps: int = 0
    """Deaths of an intake."""
    jumps: int = 0
    anew: int = 0
    begun: int = 0
    """Deaths that left a file of several which had only begun."""
    kept: int = 0
    """Runs that had to keep a damaged file, and say so."""
    incomplete: int = 0
    """Runs that ended with a recording that says what it lacks."""

    def add(self, other: "Tally") -> None:
        """Add what happened elsewhere."""
        for name in self.__struct_fields__:
            setattr(self, name, getattr(self, name) + getattr(other, name))


class Case(msgspec.Struct):
    """A simulated run, the faults it may have, and those it had, over all restarts."""

    options: RunOptions
    log: Path
    """Its recording; of several files the first."""
    split: Split | None
    """How that is spread over files; None: it is one."""
    weather: Weather
    """Of the life that it is in."""
    chance: random.Random
    """Draws all that happens."""
    tally: Tally


def random_weather(chance: random.Random) -> Weather:
    """Draw what goes wrong; in most schedules only some of it does."""
    return Weather(
        hubs=chance.choice([1, 1, 2, 3]),
        duplicate=chance.choice([0.0, 0.05, 0.3]),
        drop=chance.choice([0.0, 0.0, 0.002, 0.01]),
        slow=chance.choice([0.0, 0.0, 0.3]),
        cut=chance.choice([0.0, 0.0, 0.002, 0.01]),
        heal=chance.choice([0.01, 0.1, 0.5]),
        deaf=chance.random() < 0.5,
        late=chance.choice([0.0, 0.0, 0.002]),
        crash=chance.choice([0.0, 0.001, 0.001, 0.005]),
        flip=chance.choice([0.0, 0.0, 0.0, 0.5]),
        vanish=chance.choice([0.0, 0.0, 0.0, 0.1]),
        power=chance.choice([0.0, 0.5]),
        begun=chance.choice([0.0, 0.5]),
        full=chance.choice([0.0, 0.0, 0.0, 0.0005]),
        truncate=chance.choice([0.0, 0.0, 0.0, 0.0005]),
        twice=chance.choice([0.0, 0.0, 0.0, 0.1]),
        gap=chance.choice([0.0, 0.02, 0.1]),
        jump=chance.choice([0.0, 0.01, 0.1]),
        anew=chance.choice([0.0, 0.0, 0.0005]),
    )
