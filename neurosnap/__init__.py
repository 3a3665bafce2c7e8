"""A snapshot memory whose sensors are processes that compute by messages.

The names below are the public interface. They are loaded when first used: a cell
process imports this package and must stay free of numpy and numba.
"""

import warnings
from importlib import import_module

from neurosnap.distribution import namesake

TYPE_CHECKING = False  # as type checkers know it; typing takes 15 ms of the start
if TYPE_CHECKING:
    from neurosnap.agent.agent import Agent
    from neurosnap.agent.context import Body
    from neurosnap.agent.sensor import Sensor
    from neurosnap.binary_sensors import BinarySensors
    from neurosnap.poc.cubing import Cubing
    from neurosnap.poc.graph import PocGraph
    from neurosnap.poc.morphism import PocMorphism
    from neurosnap.poc.pocset import PocSet
    from neurosnap.poc.realization import Realization
    from neurosnap.poc.snapshot import DiscountedSnapshot, EmpiricalSnapshot
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
    "Sensor",
    "Sensorium",
]

_HOMES = {
    "Agent": "neurosnap.agent.agent",
    "BinarySensors": "neurosnap.binary_sensors",
    "Body": "neurosnap.agent.context",
    "Cubing": "neurosnap.poc.cubing",
    "DiscountedSnapshot": "neurosnap.poc.snapshot",
    "EmpiricalSnapshot": "neurosnap.poc.snapshot",
    "PocGraph": "neurosnap.poc.graph",
    "PocMorphism": "neurosnap.poc.morphism",
    "PocSet": "neurosnap.poc.pocset",
    "Realization": "neurosnap.poc.realization",
    "Sensor": "neurosnap.agent.sensor",
    "Sensorium": "neurosnap.sensorium",
}

if _NAMESAKE := namesake():
    warnings.warn(_NAMESAKE, RuntimeWarning, stacklevel=2)


def __getattr__(name: str) -> object:
    """Import a public name from its home on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
