"""Whole swarms in simulation, with all kinds of failures.

What a schedule is, and what must come of it, is in `tools.simulate.case`; a failure
names the seed, and ``tools/simulate --only SEED`` repeats it.
"""

import random
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.restart_files import RestartFiles
from tests.support.exhaustive import rows
from tests.support.hypothesis_settings import cases
from tests.support.memory_hubs import run_out
from tools.simulate.__main__ import simulated
from tools.simulate.case import live_on, random_options
from tools.simulate.check import WrongError, check
from tools.simulate.simulated_faults import Tally, Weather, random_weather
from tools.simulate.simulated_hub import Faults, SimulatedHub

BATCH = 25


def lived(
    folder: Path, seeds: range, weather: Weather | None = None, *, growing: bool = False
) -> Tally:
    """Make runs through one weather, or through a weather each."""
    total = Tally()
    for seed in seeds:
        own, chance = folder / str(seed), random.Random(seed)
        own.mkdir()
        options = random_options(chance, own, growing=growing)
        total.add(live_on(options, weather or random_weather(chance), chance, own))
    return total


@pytest.mark.slow
@pytest.mark.parametrize("batch", rows([1], [0, *range(2, 8)]))  # in 1 none grows
def test_whatever_happens_the_run_comes_to_the_same(batch: int) -> None:
    total = simulated(range(batch * BATCH, (batch + 1) * BATCH))
    assert total.schedules == BATCH
    assert min(total.crashes, total.cuts, total.losses, total.repeats) > BATCH / 2
    assert total.restarts > BATCH / 2


@pytest.mark.slow
def test_over_three_hubs_the_run_comes_to_the_same(tmp_path: Path) -> None:
    """Whichever links between them are slow or cut, and whichever hub is lost."""
    weather = Weather(hubs=3, slow=0.5, cut=0.005, heal=0.1, deaf=True, crash=0.005)
    total = lived(tmp_path, range(3, 3 + cases(20)), weather)
    assert min(total.parted, total.hubs_lost, total.restarts, total.deaf) > 0


BEFALLS = {
    "a part joins twice": (Weather(twice=1.0), "twice", 3),
    "a file is cut short": (Weather(truncate=0.005), "truncated", 3),
    # Some run in fifty dies when the file before it has its end.
    "a file has only begun": (Weather(crash=0.02, begun=1.0), "begun", 25),
    "the intake dies and comes again": (Weather(gap=0.1), "gaps", 3),
    "the clock jumps by decades": (Weather(gap=0.02, jump=0.1), "jumps", 3),
    "the hub is started anew": (Weather(anew=0.01), "anew", 3),
}


@pytest.mark.slow
@pytest.mark.parametrize(("weather", "name", "first"), BEFALLS.values(), ids=BEFALLS)
def test_what_befalls_a_recording_is_named(
    weather: Weather, name: str, first: int, tmp_path: Path
) -> None:
    total = lived(tmp_path, range(first, first + cases(40)), weather)
    assert getattr(total, name) > 0
    assert total.incomplete > 0 or name not in ("twice", "truncated")


@pytest.mark.slow
def test_whatever_happens_what_is_grown_comes_to_the_same(tmp_path: Path) -> None:
    # Cells of their own over two hubs, then workers.
    total = lived(tmp_path, range(15, 15 + cases(8)), growing=True)
    assert min(total.births, total.restarts) > 0


def test_what_fails_names_its_seed_and_how_to_see_it_again() -> None:
    def third(seed: int, folder: Path) -> Tally:
        assert folder.is_dir()
        return Tally(schedules=1 // (7 - seed))

    expected = r"(?s)ZeroDivisionError.*seed 7 fails; again: tools/simulate --only 7$"
    with pytest.raises(SystemExit, match=expected):
        simulated(range(5, 10), third)


class _Deleting(RestartFiles):
    """Deletes what a run cannot go on from, whatever is in it."""

    def _discard(self, path: Path, held_by: Sequence[Path], tick: int = 0) -> None:
        path.unlink()


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_restart_that_deletes_a_damaged_recording_is_found(tmp_path: Path) -> None:
    """Some run in twelve comes to it, and which depends on every byte of the files."""

    def living(seed: int, lives: type[RestartFiles]) -> Tally:
        folder, chance = tmp_path / f"{seed}-{lives.__name__}", random.Random(seed)
        folder.mkdir()
        options = random_options(chance, folder)
        return live_on(options, random_weather(chance), chance, folder, lives)

    def is_found(seed: int) -> bool:
        try:
            living(seed, _Deleting)
        except WrongError as error:
            if "damaged files must be kept" not in str(error):
                raise
            return True
        return False

    found = next(filter(is_found, range(200)))
    assert living(found, RestartFiles).kept


# What is wrong is found ---------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of a planner's walk to which nothing happened; to be read only."""
    folder = tmp_path_factory.mktemp("whole")
    options = RunOptions(
        source="neurosnap/Path-v0",
        arguments={"places": 4},
        body=Body(
            own=("below_1", "below_2", "below_3"),
            actions=("forward", "back"),
            senses_actions=True,
            context=((0, 0), (1, 3)),
        ),
        agent="planner",
        target=("below_1",),
        ticks=20,
        seed=5,
        threshold=0.1,
        cells="inline",
        workers=0,  # as processes are
    )
    tally = live_on(options, Weather(), random.Random(7), folder)
    assert (tally.restarts, tally.losses, tally.repeats) == (0, 0, 0)
    return folder / "run.mcap"


def test_another_run_is_told_from_the_right_one(whole: Path) -> None:
    recording = Recording.open(whole)
    options, noted = recording.options, recording.noted()
    check(whole, options, noted.completeness, noted.expected)
    for wrong, where in (
        (msgspec.structs.replace(options, ticks=options.ticks + 1), "observation"),
        (msgspec.structs.replace(options, seed=7), "observation"),
        (msgspec.structs.replace(options, threshold=0.25), "observation"),
        (msgspec.structs.replace(options, wiring="derived"), "wired at"),
    ):
        with pytest.raises(WrongError, match=rf"^{where}.*: must be "):
            check(whole, wrong, noted.completeness, noted.expected)


def test_a_message_that_nobody_misses_is_missed(whole: Path) -> None:
    recording = Recording.open(whole)
    options, noted = recording.options, recording.noted()
    for who, count in noted.expected.items():
        sent = {**noted.expected, who: count + 1}
        with pytest.raises(WrongError, match=rf"^missing of {who}: must be 1, got 0$"):
            check(whole, options, noted.completeness, sent)


# The hub's faults ---------------------------------------------------------------------


def listening(hub: SimulatedHub, *parts: str) -> list[str]:
    """Let parts listen to everything; return who got something, as it comes."""
    heard: list[str] = []

    def listen(who: str) -> None:
        hub.fabric(who).listen(("**",), lambda _: heard.append(who))

    for who in parts:
        listen(who)
    return heard


def test_what_is_lost_is_counted_by_link() -> None:
    hub = SimulatedHub(1, Faults(drop=1.0, spared=frozenset({("a", "c")})))
    heard = listening(hub, "b", "c", "d")
    hub.fabric("a").publish(*[wire.Leave("a")] * 10)
    hub.cut("c", "a")
    hub.fabric("a").publish(wire.Leave("a"))
    hub.heal("a", "c")
    hub.fabric("a").publish(wire.Leave("a"))
    run_out(hub)
    assert heard == ["c"]
    assert hub.lost == {("a", "b"): 12, ("a", "c"): 11, ("a", "d"): 12}


def test_slow_links_mostly_come_last() -> None:
    hub = SimulatedHub(3, Faults(slow=frozenset({("a", "b")})))
    heard = listening(hub, "b", "c")
    hub.fabric("a").publish(*[wire.Leave("a")] * 100)
    run_out(hub)
    assert sorted(heard) == ["b"] * 100 + ["c"] * 100
    assert 0 < heard[:100].count("b") < 30
