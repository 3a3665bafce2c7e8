"""Environments as sources: the paper's worlds, others, and what is refused of them."""

import contextlib
import logging
import warnings
from collections.abc import Iterator, Sequence
from importlib.metadata import EntryPoint
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, MultiBinary, Space

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


class TestWorlds:
    @pytest.mark.parametrize("name", IDS)
    def test_the_installed_worlds_are_found(self, name: str) -> None:
        source = open_source(name, seed=0)
        assert len(source.sensors) == 20
        assert len(source.actions) == (4 if "Grid" in name else 2)
        assert source.length is None
        bits = first(source)
        assert bits.shape == (20,)
        assert bits.dtype == np.bool_
        source.close()

    @pytest.mark.parametrize("name", IDS)
    def test_all_is_a_function_of_name_seed_and_actions(self, name: str) -> None:
        source = open_source(name, seed=5)
        once = walked(source)
        np.testing.assert_array_equal(walked(source), once)
        np.testing.assert_array_equal(walked(open_source(name, seed=5)), once)
        assert (walked(open_source(name, seed=6)) != once).any()

    def test_a_negative_seed_is_refused(self) -> None:
        with pytest.raises(
            InvalidValueError, match=r"^seed: must be 0 or more, got -1"
        ):
            open_source("neurosnap/Path-v0", seed=-1)

    def test_a_module_can_be_named(self) -> None:
        assert len(open_source("world:neurosnap/Path-v0", seed=0).actions) == 2

    @pytest.mark.parametrize("name", ["neurosnap/Path", "neurosnap/Grid"])
    def test_without_a_version_it_is_the_latest_and_no_warning(self, name: str) -> None:
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            source = open_source(name, seed=0)
        assert len(source.sensors) == 20
        assert seen == []

    def test_a_slip_gets_the_right_id_suggested(self) -> None:
        with pytest.raises(InvalidValueError) as caught:
            open_source("neurosnap/Pth-v0", seed=0)
        text = str(caught.value)
        assert text.startswith(
            "source: must be a registered environment id or a CSV file "
            "(did you mean neurosnap/Path-v0"
        )
        assert text.endswith("got 'neurosnap/Pth-v0'")

    @pytest.mark.parametrize(
        "name", ["Nowhere-v0", "", "no spaces allowed", "x" * 10_000, "data/readings"]
    )
    def test_something_else_altogether_gets_all_ids_suggested(self, name: str) -> None:
        with pytest.raises(InvalidValueError) as caught:
            open_source(name, seed=0)
        rule = caught.value.rule
        assert rule.startswith("must be a registered environment id or a CSV file")
        assert all(known in rule for known in IDS)

    @pytest.mark.parametrize("name", [":Path-v0", ".world:Path-v0", "a:b:Path-v0"])
    def test_a_module_that_cannot_be_one_is_refused(self, name: str) -> None:
        with pytest.raises(
            InvalidValueError, match=r"^source: must have a module before its colon"
        ):
            open_source(name, seed=0)

    def test_a_module_that_is_not_there_is_named(self) -> None:
        with pytest.raises(
            InvalidValueError,
            match=r"^source: must be an environment that can be imported "
            r"\(No module named 'nowhere_at_all'\)",
        ):
            open_source("nowhere_at_all:Path-v0", seed=0)

    def test_a_broken_package_of_worlds_does_not_hide_the_others(
        self, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        broken = EntryPoint("broken", "nowhere_at_all", source_module.WORLDS)
        whole = EntryPoint("paper", "world", source_module.WORLDS)
        monkeypatch.setattr(
            source_module, "entry_points", lambda group: [broken, whole]
        )
        with caplog.at_level(
            logging.ERROR, logger="neurosnap.sources.gymnasium_source"
        ):
            source = open_source("neurosnap/Path-v0", seed=0)
        assert len(source.actions) == 2
        assert [r.getMessage() for r in caplog.records] == [
            "nowhere_at_all: cannot be imported"
        ]


class Custom(gymnasium.Env[Any, Any]):
    """An environment whose every part can be set; it notes what is done to it."""

    made: "list[Custom]" = []  # noqa: RUF012

    def __init__(self, **parts: Any) -> None:
        self.observation_space: Space[Any] = parts.get("observes", MultiBinary(2))
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
def custom(**parts: Any) -> Iterator[str]:
    """Register `Custom` with `parts` for as long as the context lasts."""
    Custom.made.clear()
    limit = parts.pop("limit", None)
    gymnasium.register(
        "Custom-v0", lambda **_: Custom(**parts), max_episode_steps=limit
    )
    try:
        yield "Custom-v0"
    finally:
        del gymnasium.registry["Custom-v0"]


class TestOtherEnvironments:
    def test_sensors_without_names_are_numbered(self) -> None:
        with custom() as name:
            assert open_source(name, seed=0).sensors == ("s0", "s1")

    @pytest.mark.parametrize(
        ("sensors", "message"),
        [
            (("a",), r"sensors: must be a sequence of 2 names, got \('a',\)"),
            (7, "sensors: must be a sequence of 2 names, got 7"),
            (("a", "a"), "names: must be unique, got 'a'"),
            (("a", "b*"), r"sensor name: must not end with \*, got 'b\*'"),
            (("a", 1), "sensor name: must be text, got 1"),
            ("ab", "names: must be several, not one string, got 'ab'"),
        ],
    )
    def test_bad_names_are_refused_and_the_environment_closed(
        self, sensors: Any, message: str
    ) -> None:
        with (
            custom(sensors=sensors) as name,
            pytest.raises(InvalidValueError, match=f"^Custom-v0: {message}$"),
        ):
            open_source(name, seed=0)
        assert Custom.made[0].closed

    @pytest.mark.parametrize(
        "space", [Box(0, 1, (2,)), Discrete(4), MultiBinary((2, 2))]
    )
    def test_another_observation_space_is_refused(self, space: Any) -> None:
        with (
            custom(observes=space) as name,
            pytest.raises(
                InvalidValueError,
                match=r"^Custom-v0: observation space: must be MultiBinary with one axis",
            ) as caught,
        ):
            open_source(name, seed=0)
        assert repr(space) in str(caught.value)
        assert Custom.made[0].closed

    @pytest.mark.parametrize("space", [Box(0, 1, (2,)), MultiBinary((2, 2))])
    def test_another_action_space_is_refused(self, space: Any) -> None:
        with (
            custom(acts=space) as name,
            pytest.raises(
                InvalidValueError, match=r"^Custom-v0: action space: must be Discrete"
            ) as caught,
        ):
            open_source(name, seed=0)
        assert repr(space) in str(caught.value)
        assert Custom.made[0].closed

    def test_actions_count_from_0_wherever_the_space_starts(self) -> None:
        with custom(acts=Discrete(3, start=-1)) as name:
            source = open_source(name, seed=0)
        source.first()
        assert len(source.actions) == 3
        for action in range(3):
            source.step(action)
        assert Custom.made[0].actions == [-1, 0, 1]

    @pytest.mark.parametrize("ends", [(True, False), (False, True)])
    def test_after_the_end_of_an_episode_the_next_begins(
        self, ends: tuple[bool, bool]
    ) -> None:
        with custom(ends=ends) as name:
            source = open_source(name, seed=0)
        # What comes with an end is given out, and then a beginning.
        begins = [begun for begun, _ in beginnings(source, (0, 1, 1, 0))]
        assert begins == [True, False, True, False, True]
        # An ended episode is not stepped on: every other action is ignored.
        assert Custom.made[0].actions == [0, 1]

    def test_an_action_that_is_ignored_must_be_one_all_the_same(self) -> None:
        with custom(ends=(True, False)) as name:
            source = open_source(name, seed=0)
        source.first()
        source.step(0)
        with pytest.raises(InvalidValueError, match=r"^action: must be a whole number"):
            source.step(2)

    def test_a_limit_of_steps_ends_an_episode_too_and_first_starts_over(self) -> None:
        with custom(limit=3) as name:
            source = open_source(name, seed=0)
        for steps in (9, 6):
            begins, cut = zip(*beginnings(source, [0] * steps), strict=True)
            assert [tick for tick, one in enumerate(begins) if one] == list(
                range(0, steps + 1, 4)
            )
            # The first episode cut nothing off.
            assert cut == (False, *begins[1:])

    def test_an_episode_that_ended_was_not_cut_off(self) -> None:
        with custom(ends=(True, False)) as name:
            source = open_source(name, seed=0)
        _, *said = beginnings(source, [0] * 4)
        assert said == [(False, False), (True, False)] * 2

    def test_episodes_are_a_function_of_seed_and_actions(self) -> None:
        class Drawn(Custom):
            def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
                super().reset(seed=seed)
                return self.np_random.integers(2, size=2), {}

        gymnasium.register("Custom-v0", lambda **_: Drawn(ends=(True, False)))
        try:
            source, same, other = (open_source("Custom-v0", seed) for seed in (5, 5, 6))
        finally:
            del gymnasium.registry["Custom-v0"]
        once = walked(source)
        assert len(np.unique(once[::2], axis=0)) == 4
        np.testing.assert_array_equal(walked(source), once)
        np.testing.assert_array_equal(walked(same), once)
        assert (walked(other) != once).any()

    def test_an_environment_that_goes_on_by_itself_still_says_what_begins(self) -> None:
        gymnasium.register(
            "Custom-v0", lambda **_: Continuing(Custom(ends=(True, False)))
        )
        try:
            source = open_source("Custom-v0", seed=0)
        finally:
            del gymnasium.registry["Custom-v0"]
        begins = [begun for begun, _ in beginnings(source, [0] * 4)]
        assert begins == [True, False, True, False, True]

    def test_a_buffer_used_again_does_not_change_what_was_given(self) -> None:
        with custom() as name:
            source = open_source(name, seed=0)
        start = first(source)
        source.step(0)
        assert not start.any()

    @pytest.mark.parametrize(
        "gives", [np.zeros(3, np.int8), np.array([0, 2]), [0.5, 1]]
    )
    def test_an_observation_outside_its_space_is_refused(self, gives: Any) -> None:
        with custom(gives=gives) as name:
            source = open_source(name, seed=0)
        with pytest.raises(InvalidValueError, match=r"^Custom-v0: observation: must"):
            source.first()

    def test_closing_closes_the_environment(self) -> None:
        with custom() as name:
            open_source(name, seed=0).close()
        assert Custom.made[0].closed

    def test_a_missing_dependency_is_named(self) -> None:
        gymnasium.register("Missing-v0", "nowhere_at_all:Env")
        try:
            with pytest.raises(
                InvalidValueError, match=r"No module named 'nowhere_at_all'.*Missing-v0"
            ):
                open_source("Missing-v0", seed=0)
        finally:
            del gymnasium.registry["Missing-v0"]
