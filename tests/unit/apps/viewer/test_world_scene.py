"""What is drawn of a world follows from what its sensors read, and is what it is."""

from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv
from numpy.typing import NDArray

from neurosnap.agent.continuing import Continuing
from neurosnap.apps.viewer.qualities import NONE, Qualities
from neurosnap.apps.viewer.world_scene import Scene
from neurosnap.protocol.run_options import RunOptions
from neurosnap.sensorium import complete
from tests.support.run_options import options_for

STEPS = 3000


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


@pytest.mark.parametrize("map_name", ["4x4", "8x8"])
def test_the_walker_on_the_lake_is_where_it_is(map_name: str) -> None:
    options = options_for("neurosnap/FrozenLake-v0", 1, {"map_name": map_name})
    scene = Scene(options)
    assert scene.stage is not None
    seen = set()
    for observed, lake in walk(options):
        shown = scene.at(observed)
        assert shown == {"place": lake.s, "heading": "", "things": []}
        assert (
            scene.stage.tiles[lake.s][0].upper() == lake.desc.ravel()[lake.s].decode()
        )
        seen.add(scene.stage.tiles[lake.s])
    assert {"start", "frozen", "hole"} <= seen


def test_the_walker_at_the_cliff_is_where_it_is() -> None:
    options = options_for("neurosnap/CliffWalking-v0", 1)
    scene = Scene(options)
    assert scene.stage is not None
    assert (scene.stage.width, scene.stage.height) == (12, 4)
    assert scene.stage.tiles[36:] == ["start", *["cliff"] * 10, "goal"]
    assert scene.stage.coordinates[36] == (0, 0)
    places = set()
    for observed, cliff in walk(options):
        assert scene.place(observed) == cliff.s
        places.add(cliff.s)
    assert len(places) > 20


def test_taxi_passenger_and_destination_are_where_they_are() -> None:
    options = options_for("neurosnap/Taxi-v0", 1)
    scene = Scene(options)
    assert scene.stage is not None
    stops = [scene.stage.tiles.index(s) for s in ("red", "green", "yellow", "blue")]
    rides = 0
    for observed, cab in walk(options):
        row, column, passenger, destination = cab.decode(cab.s)
        assert scene.place(observed) == 5 * row + column
        at, to = scene.at(observed)["things"]
        assert (at.what, to.what) == ("passenger", "destination")
        assert at.place == (None if passenger == 4 else stops[passenger])
        assert to.place == stops[destination]
        rides += passenger == 4
    assert rides


def test_a_wall_of_the_town_is_where_nobody_gets_through() -> None:
    options = options_for("neurosnap/Taxi-v0", 1)
    stage = Scene(options).stage
    assert stage is not None
    cab: Any = gymnasium.make("neurosnap/Taxi-v0").unwrapped
    east = 2
    barred = {
        (place, place + 1)
        for place in range(25)
        if place % 5 < 4
        and cab.P[cab.encode(*divmod(place, 5), 0, 1)][east][0][1] // 20 == place
    }
    assert set(stage.walls) == barred


@pytest.mark.parametrize("layout", ["Empty-5x5", "DoorKey-5x5"])
def test_the_maze_is_as_it_is(layout: str) -> None:
    options = options_for("neurosnap/MiniGrid-v0", 1, {"layout": layout})
    scene = Scene(options)
    assert scene.stage is not None
    tiles = scene.stage.tiles
    carried, doors, ways = 0, set(), set()
    for observed, maze in walk(options):
        cell = maze.cells[maze.s]
        shown = scene.at(observed)
        assert shown["place"] == cell.row * maze.size[0] + cell.column
        assert shown["heading"] == cell.facing
        ways.add(cell.facing)
        things = {thing.what: thing for thing in shown["things"]}
        if layout.startswith("Empty"):
            assert not things
            continue
        assert things["door"].state == cell.door
        assert things["door"].place == tiles.index("door")
        doors.add(cell.door)
        at = things["key"].place
        assert (at is None) == (cell.carries == "key")
        assert at is None or maze.tile_map.rows[at // 5][at % 5] == "key"
        carried += at is None
    assert ways == {"north", "east", "south", "west"}
    assert not layout.startswith("Door") or (carried and len(doors) == 3)


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


@pytest.mark.parametrize("unread", range(3))
def test_a_row_is_known_only_as_far_as_it_was_read(unread: int) -> None:
    qualities = Qualities(["row<1", "row<2", "row<3"])
    for row in range(4):
        observed = literals([row < bound for bound in (1, 2, 3)])
        assert qualities.number("row", observed, 3) == row
        observed[2 * unread : 2 * unread + 2] = False
        # The reading that is missing is what tells its two sides apart.
        known = row if row not in (unread, unread + 1) else None
        assert qualities.number("row", observed, 3) == known


def test_a_quality_is_known_by_one_that_is_on_or_by_all_that_are_off() -> None:
    qualities = Qualities(["door=locked", "door=open", "x"])
    assert qualities.values(literals([1, 0, 1])) == {"door": "locked"}
    assert qualities.values(literals([0, 0, 1])) == {"door": NONE}
    contradictory = literals([1, 1, 0])
    assert qualities.values(contradictory) == {}
    unread = literals([0, 0, 0])
    unread[:2] = False
    assert qualities.values(unread) == {}


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("neurosnap/FrozenLake-v0", {"map_name": "none such"}),
        ("neurosnap/MiniGrid-v0", {"layout": "none such"}),
        ("neurosnap/Nowhere-v0", {}),
        ("FrozenLake-v1", {}),
    ],
)
def test_what_is_no_world_of_ours_is_not_made(
    name: str, arguments: dict[str, bool | int | float | str]
) -> None:
    body = options_for("neurosnap/FrozenLake-v0", 1).body
    assert Scene(RunOptions(source=name, arguments=arguments, body=body)).stage is None


def test_no_window_opens_for_a_run_that_had_one() -> None:
    real = options_for("neurosnap/FrozenLake-v0", 1)
    options = msgspec.structs.replace(real, arguments={"render_mode": "human"})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FrozenLakeEnv, "render", lambda _: pytest.fail("was drawn"))
        assert Scene(options).stage is not None


def test_sensors_of_another_version_are_not_read_as_these() -> None:
    real = options_for("neurosnap/FrozenLake-v0", 1)
    other = options_for("neurosnap/CliffWalking-v0", 1)
    options = RunOptions(source=real.source, body=other.body)
    assert Scene(options).stage is None
