"""Environments as sources: the paper's worlds, others, and invalid ones."""

import contextlib
import logging
import warnings
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import EntryPoint
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Discrete, MultiBinary, Space

from neurosnap.agent.environment import Continuing
from neurosnap.errors import InvalidValueError
from neurosnap.sources import gymnasium_source as source_module
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Source
from tests.support.sources import first, walked

IDS = [f"neurosnap/{name}-v0" for name in ("Path", "Cycle", "Grid", "RandomFields")]


def beginnings(source: Source, actions: Sequence[int]) -> list[tuple[bool, bool]]:
    """Return which observations begin a trajectory, and cut one off."""
    several = [source.first(), *map(source.step, actions)]
    return [(one.begins, one.cut) for one in several if one is not None]


@pytest.mark.parametrize("name", [*IDS, "world:neurosnap/Path-v0", "neurosnap/Grid"])
def test_a_world_is_a_function_of_name_seed_and_actions(name: str) -> None:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        source = open_source(name, seed=5)
    assert seen == []
    assert len(source.sensors) == 20
    assert len(source.actions) == (4 if "Grid" in name else 2)
    assert source.length is None
    once = walked(source)
    np.testing.assert_array_equal(walked(source), once)
    np.testing.assert_array_equal(walked(open_source(name, seed=5)), once)
    assert (walked(open_source(name, seed=6)) != once).any()
    source.close()


ANY = "source: must be a registered environment id or a CSV file"
NO_IMPORT = "source: must be an environment that can be imported"
NO_MODULE = "source: must have a module before its colon"


@pytest.mark.parametrize(
    ("name", "seed", "text"),
    [
        ("neurosnap/Path-v0", -1, "seed: must be 0 or more, got -1"),
        ("neurosnap/Pth-v0", 0, f"{ANY} (did you mean neurosnap/Path-v0"),
        *(
            (name, 0, f"{ANY} (such as neurosnap/")
            for name in ("Nowhere-v0", "", "no spaces", "x" * 10_000, "data/readings")
        ),
        *(
            (name, 0, NO_MODULE)
            for name in (":Path-v0", ".world:Path-v0", "a:b:Path-v0")
        ),
        ("nowhere_at_all:Path-v0", 0, f"{NO_IMPORT} (No module named 'nowhere"),
    ],
)
def test_what_is_no_environment_is_refused(name: str, seed: int, text: str) -> None:
    with pytest.raises(InvalidValueError) as caught:
        open_source(name, seed)
    assert str(caught.value).startswith(text)
    if name == "Nowhere-v0":
        assert all(known in caught.value.rule for known in IDS)


def test_a_broken_package_of_worlds_does_not_hide_the_others(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    broken = EntryPoint("broken", "nowhere_at_all", source_module.WORLDS)
    whole = EntryPoint("paper", "world", source_module.WORLDS)
    monkeypatch.setattr(source_module, "entry_points", lambda group: [broken, whole])
    uncached = source_module.import_worlds.__wrapped__
    monkeypatch.setattr(source_module, "import_worlds", uncached)
    with caplog.at_level(logging.ERROR, logger="neurosnap.sources.gymnasium_source"):
        assert len(open_source("neurosnap/Path-v0", seed=0).actions) == 2
    assert caplog.messages == ["nowhere_at_all: cannot be imported"]


class Custom(gymnasium.Env[Any, Any]):
    """An environment whose every part can be set; it notes what is done to it."""

    made: "list[Custom]" = []  # noqa: RUF012

    def __init__(self, **parts: Any) -> None:
        self.observation_space: Space[Any] = MultiBinary(2)
        self.action_space: Space[Any] = parts.get("acts", Discrete(2))
        if "sensors" in parts:
            self.sensors = parts["sensors"]
        self.gives = parts.get("gives", np.zeros(2, np.int8))
        self.ends = parts.get("ends", (False, False))
        self.actions: list[Any] = []
        self.closed = False
        Custom.made.append(self)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return self.gives, {}

    def step(self, action: Any) -> Any:
        self.actions.append(action)
        self.gives[0] ^= 1
        return self.gives, 0.0, *self.ends, {}

    def close(self) -> None:
        self.closed = True


@contextlib.contextmanager
def registered(
    make: Callable[..., gymnasium.Env[Any, Any]] | str, limit: int | None = None
) -> Iterator[str]:
    """Register an environment for as long as the context lasts."""
    Custom.made.clear()
    gymnasium.register("Custom-v0", make, max_episode_steps=limit)
    try:
        yield "Custom-v0"
    finally:
        del gymnasium.registry["Custom-v0"]


def opened(limit: int | None = None, **parts: Any) -> Source:
    with registered(lambda **_: Custom(**parts), limit) as name:
        return open_source(name, seed=0)


def test_bad_names_are_refused_and_the_environment_closed() -> None:
    rule = r"^Custom-v0: sensors: must be a sequence of 2 names, got 7$"
    with pytest.raises(InvalidValueError, match=rule):
        opened(sensors=7)
    assert Custom.made[0].closed


def test_actions_count_from_0_wherever_the_space_starts_and_closing_closes() -> None:
    source = opened(acts=Discrete(3, start=-1))
    source.first()
    assert len(source.actions) == 3
    for action in range(3):
        source.step(action)
    assert Custom.made[0].actions == [-1, 0, 1]
    source.close()
    assert Custom.made[0].closed


@pytest.mark.parametrize(
    ("ends", "wrapped"),
    [((True, False), False), ((False, True), False), ((True, False), True)],
)
def test_after_the_end_of_an_episode_the_next_begins(
    ends: tuple[bool, bool], wrapped: bool
) -> None:
    """So it does where the environment goes on by itself."""
    made = Custom(ends=ends)
    with registered(lambda **_: Continuing(made) if wrapped else made) as name:
        source = open_source(name, seed=0)
    # What comes with an end is given out, and then a beginning.
    begins, cut = zip(*beginnings(source, (0, 1, 1, 0)), strict=True)
    assert begins == (True, False, True, False, True)
    assert cut[1:] == ((False,) * 4 if ends[0] else begins[1:])
    # An ended episode is not stepped on: every other action is ignored.
    assert made.actions == [0, 1]
    source.step(0)
    for wrong in (-1, 2):  # it is ignored, and must be one all the same
        with pytest.raises(InvalidValueError, match=r"^action: must be a whole number"):
            source.step(wrong)


def test_a_limit_of_steps_ends_an_episode_too_and_first_starts_over() -> None:
    source = opened(limit=3)
    for steps in (9, 6):
        begins, cut = zip(*beginnings(source, [0] * steps), strict=True)
        every_fourth = [tick % 4 == 0 for tick in range(steps + 1)]
        assert [*begins] == every_fourth
        assert cut == (False, *begins[1:])  # the first episode cut nothing off


def test_a_buffer_used_again_does_not_change_what_was_given() -> None:
    source = opened()
    start = first(source)
    source.step(0)
    assert not start.any()


@pytest.mark.parametrize("gives", [np.zeros(3, np.int8), np.array([0, 2]), [0.5, 1]])
def test_an_observation_outside_its_space_is_refused(gives: Any) -> None:
    with pytest.raises(InvalidValueError, match=r"^Custom-v0: observation: must"):
        opened(gives=gives).first()


def test_a_missing_dependency_is_named() -> None:
    rule = r"No module named 'nowhere_at_all'.*Custom-v0"
    with (
        registered("nowhere_at_all:Env") as name,
        pytest.raises(InvalidValueError, match=rule),
    ):
        open_source(name, seed=0)
