"""The worlds of the paper as Gymnasium environments.

Importing this package registers them; an id that is registered already is left alone,
so that importing twice is the same as importing once. `gymnasium.make` takes a world's
own arguments and ``target``: a place, or ``"drawn"`` (see `world.making`).

A world is a finite set of places, what each action does to the place, and for every
sensor its field: the places at which it is on. All of it is known here, so what an
agent has learned can be compared with what is true (`World.implications`).

References:
    [GK] Guralnik and Koditschek, "Universal Memory Architectures for Autonomous
    Machines", section "Performance of Empirical Agents", settings (a) to (d); section
    "Control with Snapshots", the punctured grid, the circular rail and
    excitation-driven navigation.
"""

import gymnasium

_WORLDS = {
    "neurosnap/Path-v0": "world.making:path",
    "neurosnap/Cycle-v0": "world.making:cycle",
    "neurosnap/Grid-v0": "world.making:grid",
    "neurosnap/RandomFields-v0": "world.making:random_fields",
    "neurosnap/PuncturedGrid-v0": "world.making:punctured_grid",
    "neurosnap/Rail-v0": "world.making:rail",
    "neurosnap/FrozenLake-v0": "world.toy_text:frozen_lake",
    "neurosnap/CliffWalking-v0": "world.toy_text:cliff_walking",
    "neurosnap/Taxi-v0": "world.toy_text:taxi",
}

for _name, _home in _WORLDS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(id=_name, entry_point=_home)
