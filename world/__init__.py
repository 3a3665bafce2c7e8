"""The worlds of the paper as Gymnasium environments.

Importing this package registers them; an id that is registered already is left alone,
so that importing twice is the same as importing once.

A world is a finite set of places, what each action does to the place, and for every
sensor its field: the places at which it is on. All of it is known here, so what an
agent has learned can be compared with what is true (`World.implications`).

References:
    [GK] Guralnik and Koditschek, "Universal Memory Architectures for Autonomous
    Machines", section "Performance of Empirical Agents", settings (a) to (d).
"""

import gymnasium

_WORLDS = {
    "neurosnap/Path-v0": "world.path:PathWorld",
    "neurosnap/Cycle-v0": "world.cycle:CycleWorld",
    "neurosnap/Grid-v0": "world.grid:GridWorld",
    "neurosnap/RandomFields-v0": "world.random_fields:RandomFieldsWorld",
}

for _name, _home in _WORLDS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(id=_name, entry_point=_home)
