"""A distributed snapshot memory: one process per sensor, exchanging messages.

The names below are the public interface. They are loaded when first used: a cell
process imports this package and must stay free of numpy and numba.
"""

import warnings
from importlib import import_module

from neurosnap.system.distribution import namesake

TYPE_CHECKING = False  # as type checkers know it; typing takes 15 ms of the start
if TYPE_CHECKING:
    from neurosnap.agent.agent import Agent
    from neurosnap.agent.binary_sensors import BinarySensors
    from neurosnap.agent.body import Body
    from neurosnap.agent.sensor import Sensor
    from neurosnap.apps.export.order_picture import plot_order
    from neurosnap.apps.library import Recording, measure_depth, run
    from neurosnap.poc.dual.cubing import Cubing
    from neurosnap.poc.dual.morphism import PocMorphism
    from neurosnap.poc.dual.realization import Realization
    from neurosnap.poc.learning.discounted import DiscountedSnapshot
    from neurosnap.poc.learning.empirical import EmpiricalSnapshot
    from neurosnap.poc.learning.relation_table import implications
    from neurosnap.poc.order.graph import PocGraph
    from neurosnap.poc.order.pocset import PocSet
    from neurosnap.sensorium import Sensorium

__all__ = [
    "Agent",
    "BinarySensors",
    "Body",
    "Cubing",
    "DiscountedSnapshot",
    "EmpiricalSnapshot",
    "PocGraph",
    "PocMorphism",
    "PocSet",
    "Realization",
    "Recording",
    "Sensor",
    "Sensorium",
    "implications",
    "measure_depth",
    "plot_order",
    "run",
]

_HOMES = {
    "Agent": "neurosnap.agent.agent",
    "BinarySensors": "neurosnap.agent.binary_sensors",
    "Body": "neurosnap.agent.body",
    "Cubing": "neurosnap.poc.dual.cubing",
    "DiscountedSnapshot": "neurosnap.poc.learning.discounted",
    "EmpiricalSnapshot": "neurosnap.poc.learning.empirical",
    "PocGraph": "neurosnap.poc.order.graph",
    "PocMorphism": "neurosnap.poc.dual.morphism",
    "PocSet": "neurosnap.poc.order.pocset",
    "Realization": "neurosnap.poc.dual.realization",
    "Recording": "neurosnap.apps.library",
    "Sensor": "neurosnap.agent.sensor",
    "Sensorium": "neurosnap.sensorium",
    "implications": "neurosnap.poc.learning.relation_table",
    "measure_depth": "neurosnap.apps.library",
    "plot_order": "neurosnap.apps.export.order_picture",
    "run": "neurosnap.apps.library",
}

if _NAMESAKE := namesake():
    warnings.warn(_NAMESAKE, RuntimeWarning, stacklevel=2)


def __getattr__(name: str) -> object:
    """Import a public name from its home on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
