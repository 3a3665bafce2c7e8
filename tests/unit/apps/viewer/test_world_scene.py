"""The drawing of a world matches its sensor readings."""

from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.environment import Continuing
from neurosnap.apps.viewer.world_scene import Scene
from neurosnap.protocol.run_options import RunOptions
from neurosnap.sensorium import complete
from tests.support.run_options import options_for

STEPS = 1000


def walk(options: RunOptions, seed: int = 1) -> Any:
    """Yield the literals read at each step of a random walk, and the environment."""
    arguments: dict[str, Any] = dict(options.arguments)
    env: Any = Continuing(gymnasium.make(options.source, **arguments))
    chance = np.random.default_rng(seed)
    readings, _ = env.reset(seed=seed)
    for _ in range(STEPS):
        yield literals(readings), env.unwrapped
        readings, *_ = env.step(int(chance.integers(env.action_space.n)))
    env.close()


def literals(readings: Any) -> NDArray[np.bool_]:
    return complete(np.asarray(readings, np.bool_))


@pytest.mark.parametrize(
    ("world", "kind"),
    [
        ("Path", "path"),
        ("Cycle", "cycle"),
        ("Rail", "cycle"),
        ("Grid", "grid"),
        ("PuncturedGrid", "grid"),
        ("RandomFields", "path"),
    ],
)
def test_each_world_of_places_is_drawn_as_what_it_is(world: str, kind: str) -> None:
    options = options_for(f"neurosnap/{world}-v0", 1)
    scene = Scene(options)
    assert scene.stage is not None
    assert scene.stage.kind == kind
    for observed, env in walk(options):
        assert scene.place(observed) == env._place


def test_where_two_places_read_the_same_neither_is_said() -> None:
    arguments = {"places": 8, "sensors": 2}
    options = options_for("neurosnap/RandomFields-v0", 1, arguments)
    scene = Scene(options)
    assert scene.stage is not None
    alike = 0
    for observed, env in walk(options):
        columns = env.fields.T.tolist()
        alone = columns.count(columns[env._place]) == 1
        assert scene.place(observed) == (env._place if alone else None)
        alike += not alone
    assert alike


@pytest.mark.parametrize(
    ("name", "arguments", "sensors"),
    [
        ("neurosnap/Path-v0", {"none such": 1}, "Path"),
        ("neurosnap/Path-v0", {"max_episode_steps": 0}, "Path"),
        ("neurosnap/Path-v0", {}, "Cycle"),  # as another version has them
        ("neurosnap/FrozenLake-v0", {}, "Path"),
        ("neurosnap/Nowhere-v0", {}, "Path"),
        ("FrozenLake-v1", {}, "Path"),
    ],
)
def test_what_is_no_world_of_ours_is_not_made(
    name: str, arguments: dict[str, bool | int | float | str], sensors: str
) -> None:
    body = options_for(f"neurosnap/{sensors}-v0", 1).body
    assert Scene(RunOptions(source=name, arguments=arguments, body=body)).stage is None


def test_a_run_that_had_a_window_is_looked_at_without_one() -> None:
    real = options_for("neurosnap/Path-v0", 1)
    options = msgspec.structs.replace(real, arguments={"render_mode": "human"})
    assert Scene(options).stage is not None
