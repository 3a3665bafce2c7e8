"""Opens a source by its name: Gymnasium, a CSV file, or live sensors.

After k steps a source returns a function of its name, the seed and the actions only;
live sources cannot: they cannot be brought back to where they were. `open_source`
checks whatever can be checked first: a file with a bad row 900 is refused before
anything is started, not at tick 900.
"""

from collections.abc import Mapping
from pathlib import Path

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import visible
from neurosnap.sources.csv_source import CsvSource
from neurosnap.sources.gymnasium_source import GymnasiumSource
from neurosnap.sources.live.zenoh_source import Hub
from neurosnap.sources.open_live import Argument as Argument
from neurosnap.sources.open_live import is_live, open_live
from neurosnap.sources.protocol import Source


def open_source(
    name: str,
    seed: int,
    arguments: Mapping[str, Argument] | None = None,
    hub: Hub | None = None,
    renders: bool = False,
) -> Source:
    """Return the source called `name`.

    Args:
        name: The path of a CSV file (it ends with ``.csv``, or the file exists), or the
            id of a Gymnasium environment, ``module:Id`` to import a module first; or
            one that is outside, as `neurosnap.sources.open_live` has it.
        seed: For the environment's reset, from 0 up; a file does not use it.
        arguments: The environment's own; a file takes none.
        hub: The swarm's, for whoever is about to be its world.
        renders: Whether images of it are wanted; the observations are the same.

    Raises:
        InvalidValueError: There is no such source, it does not take such arguments, or
            it is not fit for use, or draws no images; for a file the text names the row
            and the column.
    """
    opened = _opened(name, seed, arguments, hub, renders)
    # Not refused by `Sensorium`: there may be recordings with such names.
    for called in (*opened.sensors, *opened.actions):
        if visible(called) != called:
            opened.close()
            rule = "must have no letters that hide, or turn the text around"
            raise InvalidValueError("name", rule, called)
    return opened


def _opened(
    name: str,
    seed: int,
    arguments: Mapping[str, Argument] | None,
    hub: Hub | None,
    renders: bool,
) -> Source:
    if seed < 0:
        raise InvalidValueError("seed", "must be 0 or more", seed)
    arguments = {} if arguments is None else arguments
    if is_live(name):
        return open_live(name, arguments, hub)
    if name.lower().endswith(".csv") or _is_file(name):
        if arguments:
            rule = "must not be given for a file"
            raise InvalidValueError("arguments", rule, dict(arguments))
        return CsvSource(name)
    return GymnasiumSource(name, seed, arguments, renders)


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except OSError:  # too long for a path, for one
        return False
