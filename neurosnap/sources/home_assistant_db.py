"""Reads the database of Home Assistant's recorder, ``home-assistant_v2.db``.

It is opened for reading only, and may be in use meanwhile. Binary sensors are read by
themselves; others if they are asked for.
"""

import sqlite3
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.sources.conditions import Comparison, plain_unit
from neurosnap.sources.cuts import with_cuts
from neurosnap.sources.event_log import Events
from neurosnap.sources.readings import Readings
from neurosnap.sources.wanted import Wanted

MAGIC = b"SQLite format 3\x00"
_BINARY = "binary_sensor."
_STATES = """
    SELECT metadata_id, state, last_updated_ts FROM states
    WHERE metadata_id IS NOT NULL AND last_updated_ts IS NOT NULL
    ORDER BY last_updated_ts, state_id
"""

_ATTRIBUTES = """
    SELECT DISTINCT shared_attrs FROM state_attributes
    JOIN states ON states.attributes_id = state_attributes.attributes_id
    JOIN states_meta ON states_meta.metadata_id = states.metadata_id
    WHERE states_meta.entity_id = ?
"""

_SETTINGS = Path(".storage", "core.config")
"""Where Home Assistant keeps its settings, beside the database."""


class _Settings(msgspec.Struct):
    """What is looked at of Home Assistant's settings."""

    class Data(msgspec.Struct):
        """The settings themselves."""

        time_zone: str

    data: Data


class _Attributes(msgspec.Struct):
    """What is looked at of the attributes of a state."""

    unit: str | None = msgspec.field(name="unit_of_measurement", default=None)


def read_home_assistant(path: str, wanted: Wanted) -> Readings:
    """Return the readings of a home's sensors.

    Args:
        path: Where the database is.
        wanted: Which entities to read; by themselves binary sensors are.

    Raises:
        InvalidValueError: It is no such database, lacks an entity that is wanted, or
            has it in another unit; or a state that is wanted says neither on nor off.
    """
    uri = f"{Path(path).absolute().as_uri()}?mode=ro"
    if not Path(f"{path}-wal").exists():
        # Not being written, it needs no file beside it, nor the right to make one.
        uri += "&immutable=1"
    try:
        with closing(sqlite3.connect(uri, uri=True)) as database:
            return _read(database, path, wanted)
    except sqlite3.Error as error:
        rule = "must be a database of Home Assistant 2023.4 or newer"
        raise InvalidValueError(path, rule, str(error)) from error


def _read(database: sqlite3.Connection, path: str, wanted: Wanted) -> Readings:
    entities: dict[int, str] = dict(
        database.execute("SELECT metadata_id, entity_id FROM states_meta")
    )
    wanted = wanted.parsed()
    wanted.check(list(entities.values()), path)
    for comparison in wanted.conditions:
        if isinstance(comparison, Comparison) and comparison.unit:
            units = _units(database, comparison.source)
            if units != {comparison.unit}:
                rule = f"must be in {comparison.unit}, as --when says"
                found = ", ".join(sorted(units)) or "no unit"
                raise InvalidValueError(f"{path}: {comparison.source}", rule, found)
    if wanted.patterns:  # by themselves only those are read that say on and off
        taken = {n for n, name in entities.items() if wanted.takes(name)}
        states = database.execute(_STATES)
        said = ((entities[n], s or "", True) for n, s, _ in states if n in taken)
        wanted = with_cuts(wanted, said)
    readers = {
        number: wanted.readers(name, name.startswith(_BINARY))
        for number, name in entities.items()
    }
    if not any(readers.values()):
        rule = "must have binary sensors; name others with --sensors or --when"
        raise InvalidValueError(path, rule, sorted(entities.values()))
    events = Events()
    for number, state, time in database.execute(_STATES):
        for reader in readers.get(number, ()):
            # An entity that was removed has no state.
            events.read(time, reader, state or "", path, entities[number])
    return replace(events.readings(), zone=_zone(path), wanted=wanted)


def _zone(path: str) -> str:
    """Return the home's time zone by the settings beside a database; UTC if unknown."""
    try:
        text = Path(path).parent.joinpath(_SETTINGS).read_bytes()
        return msgspec.json.decode(text, type=_Settings).data.time_zone
    except (OSError, msgspec.MsgspecError):
        return "UTC"


def _units(database: sqlite3.Connection, entity: str) -> set[str]:
    """Return the units that an entity's states were in; those without one are left out.

    Home Assistant keeps attributes once for all states that share them.
    """
    units = set()
    for (text,) in database.execute(_ATTRIBUTES, (entity,)):
        with suppress(msgspec.MsgspecError):
            unit = msgspec.json.decode(text or "{}", type=_Attributes).unit
            units |= {plain_unit(unit)} if unit else set()
    return units
