"""One simulated case: a run, its faults, and its expected result.

A schedule is a function of its seed alone. Supervision is one for all, as in
`neurosnap.runtime.run_with_restarts`: when a life of the swarm ends before its time,
the next goes on from the last whole tick of what is on disk.
"""

import logging
import random
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import RecordingError, SwarmError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.write.rotation import Split
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.sources.open import open_source
from tests.support.lamp import lamp_options
from tests.support.simulated_intake import Intake
from tests.support.sources import written
from tools.simulate.check import WrongError, check
from tools.simulate.disk import Disk
from tools.simulate.simulated_faults import Case, Tally, Weather, random_weather
from tools.simulate.swarm import Life

if TYPE_CHECKING:
    from neurosnap.sources.protocol import Argument

# Files are cut small here on purpose, and nobody is to hear of it.
logging.getLogger("neurosnap").addHandler(logging.NullHandler())
_CALM = Weather()  # once the worst is over, so that every run comes to its end


def simulate(seed: int, folder: Path) -> Tally:
    """Make the run of a seed through all that happens, and check what came of it.

    Args:
        seed: Draws everything.
        folder: Where its files go; empty.

    Raises:
        WrongError: It did not come to what it must.
        Exception: Anything else that goes wrong is wrong, too.
    """
    chance = random.Random(seed)
    options, weather = random_options(chance, folder), random_weather(chance)
    return live_on(options, weather, chance, folder)


def live_on(
    options: RunOptions,
    weather: Weather,
    chance: random.Random,
    folder: Path,
    new_lives: Callable[[Path], RestartFiles] = RestartFiles,
) -> Tally:
    """Let one life follow the other until one comes to its end; see `simulate`."""
    tally, past = Tally(schedules=1), None
    bad = chance.choice([1, 2, 4, 8])
    split = chance.choice([None, Split(500), Split(5000)])
    log = folder / "run.mcap"
    case = Case(options, log, split, weather, chance, tally)
    lives, disk = new_lives(log), Disk(case)
    is_file = options.source.endswith(".csv")
    intake = Intake(case) if is_file and options.seed & 16 else None
    while True:
        if tally.restarts >= bad:
            case.weather = _CALM
        try:
            completeness, sent = Life(case, past, disk, intake).live()
        except SwarmError:
            disk.decay()
            found = lives.furthest(options)
            if not (tally.flips or tally.truncated or tally.twice or tally.deaf):
                _check_resumed(log, options, found)
            _, past = lives.go_on(found, past)
            tally.restarts += 1
            continue
        lives.finish()
        if lost := disk.lost():
            raise WrongError(f"{log}: {len(lost)} damaged files must be kept")
        if lives.kept or lives.unread:
            tally.kept += 1
        if lives.unread:
            if not (tally.flips or tally.powercuts or tally.truncated or tally.twice):
                raise WrongError(f"{log}: must be read whole, not {lives.unread}")
            return tally  # some of it cannot be read, and it says so
        vanished = completeness.vanished
        if past is not None and past.part:
            # The files of lives before it say what they lack by themselves.
            recording = Recording.open(log)
            completeness = recording.balance(recording.sequences())
        named = bool(vanished) or not completeness.whole
        if named and (tally.truncated or tally.twice):
            tally.incomplete += 1
            return tally  # it says so
        # What the disk or the network took from it, the files before may have.
        harmed = tally.flips or tally.powercuts or tally.truncated
        kept = lives.kept and not (harmed or tally.begun or tally.twice)
        if kept and completeness.whole:
            raise WrongError(f"{log}: must hold all that is in {lives.kept}")
        if intake is not None:
            intake.check()
        check(log, options, completeness, sent, () if intake is None else intake.rows)
        tally.ticks += options.ticks
        tally.births += _births(log)
        tally.files += len(part_paths(log))
        tally.incomplete += not completeness.whole
        return tally


def _check_resumed(log: Path, options: RunOptions, found: ResumePoint | None) -> None:
    """Whoever goes on with a run by hand comes as far as its supervision does.

    Raises:
        WrongError: It is not so, or nobody can look at what is recorded.
    """
    if found is None:
        return
    try:
        _, by_hand = find_resume_point(log, options.ticks - 1)
        Recording.open(log)
    except RecordingError as error:
        raise WrongError(
            f"{log}: must go on from tick {found.tick}: {error}"
        ) from error
    if by_hand.tick != found.tick:
        raise WrongError(f"{log}: must go on from {found.tick}, not {by_hand.tick}")


def _births(log: Path) -> int:
    """Return how many sensors a recorded run has grown."""
    messages = (
        recorded.message for recorded in Recording.open(log).messages(("decision",))
    )
    return sum(isinstance(m, wire.Decision) and m.born >= 0 for m in messages)


# What is drawn ------------------------------------------------------------------------


def random_options(
    chance: random.Random, folder: Path, *, growing: bool = False
) -> RunOptions:
    """Draw a run of 5 to 25 ticks in cells or among workers.

    It has 2 to 8 sensors; where some are grown 26 and more, or up to 132 ticks.
    One in ten does, unless it is to be `growing`.
    """
    kind = 1.0 if growing else chance.random()
    if kind < 0.4:
        made = _readings(chance, folder)
    else:
        made = _path(chance) if kind < 0.9 else _growing(chance, folder)
    sensors, grows = len(made.sensors), made.body.room > 0
    empirical = chance.random() < (0.8 if grows else 0.5)
    return msgspec.structs.replace(
        made,
        seed=chance.getrandbits(32),
        # Coarse enough that either snapshot learns within a few ticks; but what is
        # believed in spite of exceptions surprises no agent that grows sensors.
        snapshot="empirical" if empirical else "discounted",
        threshold=chance.choice([0.01] if grows else [0.01, 0.1, 0.25])
        if empirical
        else 1 / 16,
        decay=None if empirical else 0.9 if grows else 0.75,
        wiring=chance.choice(["hasse", "derived"]),
        cells=chance.choice(["process", "worker"]),
        workers=chance.randint(1, min(3, sensors)),
        keyframe_every=chance.choice([1, 3, 1000]),
        # A grown sensor's history is of some thousand bytes.
        band=chance.choice([1 << 20, 1 << 10] if grows else [1 << 20, 1, 4]),
    )


def _readings(chance: random.Random, folder: Path) -> RunOptions:
    """Readings that repeat themselves: much is learned, and then broken."""
    sensors = chance.randint(2, 8)
    pool = [[chance.random() < 0.5 for _ in range(sensors)] for _ in range(4)]
    rows: list[list[bool | None]] = [
        list(chance.choice(pool)) for _ in range(chance.randint(5, 25))
    ]
    for row in rows[len(rows) // 2 :]:
        if chance.random() < 0.3:
            sensor = chance.randrange(sensors)
            row[sensor] = not row[sensor]
    unknown = chance.choice([0.0, 0.0, 0.3])
    for row in rows:  # of each something is known: else no wave could start
        for sensor in chance.sample(range(sensors), sensors - 1):
            if chance.random() < unknown:
                row[sensor] = None
    names = tuple(f"s{number}" for number in range(sensors))
    table = [
        names,
        *(["" if bit is None else str(int(bit)) for bit in row] for row in rows),
    ]
    path = written(folder, "\n".join(map(",".join, table)) + "\n")
    ticks = chance.choice([len(rows), 5, 25])  # with 25, it may be the source that ends
    return RunOptions(source=str(path), body=Body(own=names), ticks=ticks)


def _path(chance: random.Random) -> RunOptions:
    """A path to walk along; in half of them actions are sensed, in contexts or not."""
    looks_back = chance.random() < 0.5
    own = chance.randint(1, 4) if looks_back else chance.randint(2, 8)
    arguments: dict[str, Argument] = {"places": own + 1}
    source = open_source("neurosnap/Path-v0", 0, arguments)
    source.close()
    contexts: list[tuple[int, int]] = []
    if looks_back:
        every = [(action, a) for action in range(2) for a in range(2 * own)]
        contexts = chance.sample(every, chance.randint(0, min(6 - own, len(every))))
    plans = looks_back and chance.random() < 0.5
    return RunOptions(
        source="neurosnap/Path-v0",
        arguments=arguments,
        body=Body(
            own=source.sensors,
            actions=source.actions,
            senses_actions=looks_back,
            context=tuple(contexts),
        ),
        agent="planner" if plans else "walker",
        target=source.sensors[:1] if plans else (),
        ticks=chance.randint(5, 25),
    )


def _growing(chance: random.Random, folder: Path) -> RunOptions:
    """A lamp: what it takes to light it is grown after some 20 to 40 ticks.

    Or readings of two switches and a lamp: what lights it is grown after 128.
    """
    room = chance.randint(1, 3)
    if chance.random() < 0.5:
        rows = [[chance.random() < 0.6 for _ in range(2)] for _ in range(132)]
        table = "".join(f"{a:d},{b:d},{a and b:d}\n" for a, b in rows)
        path = written(folder, f"a,b,lit\n{table}")
        body = Body(own=("a", "b", "lit"), room=room)
        return RunOptions(source=str(path), body=body, ticks=chance.randint(128, 132))
    return lamp_options(grow=room, ticks=chance.randint(40, 50))
