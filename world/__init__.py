"""The worlds of the paper as Gymnasium environments.

Importing this package registers them; an id that is registered already is left alone,
so that importing twice is the same as importing once. `gymnasium.make` takes a world's
own arguments and ``target``: a place, or ``"drawn"`` (see `world.worlds_with_targets`).

A wheel has this package under the name ``neurosnap_world``. Imports in it are relative,
so that it works under both names, and an editable install knows it by both.

A world is a finite set of places, what each action does to the place, and for every
sensor its field: the places at which it is on. All of it is known here, so what an
agent has learned can be compared with what is true (`PlacesWorld.implications`).

References:
    [GK] Guralnik and Koditschek, "Universal Memory Architectures for Autonomous
    Machines", section "Performance of Empirical Agents", settings (a) to (d); section
    "Control with Snapshots", the punctured grid, the circular rail and
    excitation-driven navigation.
"""

import gymnasium

_WORLDS = {
    "neurosnap/Path-v0": "worlds_with_targets:path",
    "neurosnap/Cycle-v0": "worlds_with_targets:cycle",
    "neurosnap/Grid-v0": "worlds_with_targets:grid",
    "neurosnap/RandomFields-v0": "worlds_with_targets:random_fields",
    "neurosnap/PuncturedGrid-v0": "worlds_with_targets:punctured_grid",
    "neurosnap/Rail-v0": "worlds_with_targets:rail",
    "neurosnap/FrozenLake-v0": "toy_text:frozen_lake",
    "neurosnap/CliffWalking-v0": "toy_text:cliff_walking",
    "neurosnap/Taxi-v0": "toy_text:taxi",
    "neurosnap/MiniGrid-v0": "minigrid:minigrid",
    "neurosnap/Sokoban-v0": "sokoban:sokoban",
    "neurosnap/Robot-v0": "robot_world:RobotWorld",
}

for _name, _home in _WORLDS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(id=_name, entry_point=f"{__name__}.{_home}")
