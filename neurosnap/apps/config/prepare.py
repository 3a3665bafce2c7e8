"""Turns a run's description into the request that starts it.

Whatever can be refused before a run starts is refused here, and all of it at once: the
source is opened, the agent fitted to it, keys are read and the recording's place looked
at. Nothing is started, made or written.
"""

import logging
import shlex
import stat
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec import UNSET

from neurosnap.agent.body import Body
from neurosnap.agent.policy import default_threshold
from neurosnap.apps.config.load import Loaded, described
from neurosnap.apps.config.problems import Keys, dotted
from neurosnap.apps.config.sources import FileTable, MqttTable
from neurosnap.apps.config.tables import (
    Config,
    RecordingTable,
    flattened,
)
from neurosnap.apps.config.validate import Problem, known_keys
from neurosnap.apps.new_files import LOGS, free_log, new_path
from neurosnap.errors import InvalidValueError
from neurosnap.health.follower import usual_step
from neurosnap.poc.learning.automatic_threshold import AUTO
from neurosnap.protocol.option_declaration import declared
from neurosnap.protocol.run_options import (
    FEW_CELLS,
    FOREVER,
    CellKind,
    RunOptions,
)
from neurosnap.runtime.fit_agent import body_of, drawn_to
from neurosnap.runtime.preflight import check_cells, check_sensors
from neurosnap.runtime.remote_parts import among, parse_ranges
from neurosnap.runtime.request import RunRequest, Site, check_swarm
from neurosnap.sources.camera import try_camera
from neurosnap.sources.open import (
    ZENOH,
    is_file,
    is_live,
    needs_listening,
    open_source,
    settle,
)
from neurosnap.sources.open_readings import FileSource
from neurosnap.sources.protocol import Argument
from neurosnap.system.local_time import system_zone

_logger = logging.getLogger(__name__)
_SYNC = 1.0
"""Seconds of readings from outside that a power cut may cost."""
_ALARMS = "1/week"
_WORKERS = 2
_HOME = 200
"""Sensors with times that are judged unasked, at most. To learn of them anew takes a
second for 50, half a minute for 150, and more than in proportion for more."""
_DERIVED = ("agent.", "snapshot.k", "snapshot.t", "snapshot.d", "anomalies.", "health.")
"""Keys of what follows from readings begin like this."""
_CALLED = {"source": ("id", "path", "kind"), "out": ("path",), "network": ("tls",)}
"""The keys of what has another name where it is refused, or that of a file in it: the
first that there is."""


def prepare(
    loaded: Loaded, swarm: str = "", *, here: bool = True, listens: bool = True
) -> RunRequest:
    """Return the request of a run.

    Args:
        loaded: Its description.
        swarm: Its id; empty for a random one.
        here: Whether its cells run on this machine, but for those that the description
            says are elsewhere.
        listens: Whether the source may be listened to, where only that tells its
            sensors; if not, what depends on them is not looked for.

    Raises:
        InvalidValueError: There can be no such id.
        ConfigError: What is described cannot be run: everything that was found is
            named, each with its line. What needs the source is not looked for where
            that cannot be opened, nor what needs a table with a wrong value.
    """
    if swarm:
        check_swarm(swarm)
    config, folder = loaded.config, loaded.origin.folder
    judge = _Judge(config)
    name, given = config.source.opening(folder)
    network = config.network
    if network.tls:
        network = msgspec.structs.replace(network, tls=str(folder / network.tls))
    log: Path | None = None
    fitted: _Fitted | None = None
    options: RunOptions | None = None
    away: frozenset[str] = frozenset()
    if "source" not in loaded.wrong:
        with judge.of("source", "agent"):
            if listens or not needs_listening(name, given):
                fitted = _fit(config, name, given)
            _warn_of_secrets(config, folder)
    with judge.of("recording"):
        options = _options(config, name, fitted or _NOTHING)
        if "recording" not in loaded.wrong:
            log = _log(config, folder, name)
    # What is wrong with the recording hides nothing of the rest.
    plain = msgspec.structs.replace(config, recording=RecordingTable())
    rest = _options(plain, name, fitted or _NOTHING)
    with judge.of("snapshot"):
        rest.new_snapshot()
    if fitted is not None:
        with judge.of("agent"):
            rest.new_policy(rest.new_memory())
        with judge.of("cells"):
            away = _away(config, rest, swarm)
            _check_cells(rest, away, here=here)
    with judge.of("placement", "cells"):
        config.placement.check(rest.cells)
    with judge.of("network"):
        network.check()
    found = [*loaded.found, *judge.found]
    if found or options is None:
        raise loaded.origin.error(found)
    site = Site(network, config.placement, swarm, away)
    return RunRequest(options, log, site=site, supervision=config.supervision)


def other_options(options: RunOptions, given: Mapping[str, object]) -> RunOptions:
    """Return a recorded run's options, with others for what follows from readings.

    Raises:
        InvalidValueError: A key is about something else, or a value is wrong.
    """
    fields = {one.shown.at: one.field for one in declared(RunOptions)}
    fields |= {"agent.target": "target"}
    known = [key for key in sorted(fields) if key.startswith(_DERIVED)]
    for key in given:
        if key not in known:
            rule = f"must be one of {', '.join(known)}, as what was read stays"
            raise InvalidValueError("set", rule, key)
    loaded = described("-", given, {})
    if loaded.found:
        raise loaded.origin.error(loaded.found)
    flat = flattened(loaded.config) | {"target": _names(loaded.config.agent.target)}
    changed = {fields[key]: flat[fields[key]] for key in given}
    other = msgspec.structs.replace(options, **changed)
    if other.threshold == AUTO != options.threshold and other.snapshot == "empirical":
        # In a world that is not discrete it would have been the recorded one.
        exact = default_threshold(options.body, discrete=True)
        return msgspec.structs.replace(other, threshold=exact)
    return other


def _away(config: Config, options: RunOptions, swarm: str) -> frozenset[str]:
    """Return the parts that are started elsewhere."""
    text, network = config.cells.elsewhere, config.network
    if not text:
        return frozenset()
    if options.cells == "inline":
        rule = "must go with cells that are processes, or in workers"
        raise InvalidValueError("elsewhere", rule, text)
    if not swarm or not (network.listen or network.connect):
        rule = "must come with --swarm ID, and --listen or --connect"
        raise InvalidValueError("elsewhere", rule, text)
    hosts = options.host_names()
    kind = "workers" if options.sharing else "cells"
    try:
        numbers = among(parse_ranges("elsewhere", text), kind, len(hosts))
    except InvalidValueError as error:
        raise InvalidValueError("elsewhere", error.rule, text) from error
    return frozenset(hosts[number] for number in numbers)


def _warn_of_secrets(config: Config, folder: Path) -> None:
    """Say so where a password stands in a file that every user may read."""
    if not isinstance(config.source, MqttTable):
        return
    secret = config.source.broker.password_file
    if secret is not None and (folder / secret).stat().st_mode & stat.S_IRWXO:
        path = folder / secret
        _logger.warning(
            "%s: holds a password and must not be open to everybody: chmod o= %s",
            path,
            shlex.quote(str(path)),
        )


def _check_cells(options: RunOptions, away: frozenset[str], *, here: bool) -> None:
    """Refuse cells that do not fit this machine, or that the source cannot reach."""
    options.host_names()
    if options.source == ZENOH and options.cells == "inline":
        rule = "must be 'process' or 'worker' for a source of kind zenoh"
        raise InvalidValueError("kind", rule, options.cells)
    if here and options.cells == "process":
        check_cells(len(options.sensors) - len(away))


class _Fitted(NamedTuple):
    """An agent fitted to a source."""

    body: Body
    arguments: dict[str, Argument]
    target: tuple[str, ...]
    length: int | None
    """Observations there will be at most; None if no end is known."""
    discrete: bool
    """Whether the source shows the states of a discrete world."""
    zone: str | None
    """The time zone of its observations; None if they have no times."""
    step: float = 0.0
    """Of a machine's health, in seconds; 0 if it may be a home."""


_NOTHING = _Fitted(Body(own=()), {}, (), None, False, None)
"""Stands where there is no source, for what can be judged without."""


def _fit(config: Config, name: str, given: dict[str, Argument]) -> _Fitted:
    """Open the source, for the names of its sensors, and fit the agent to it."""
    if isinstance(config.source, FileTable) and not is_file(name):
        rule = "must be a file of readings, or the folder of a bag"
        raise InvalidValueError("path", rule, name)
    arguments = settle(name, given)
    agent, seed = config.agent, config.run.seed
    target = _names(agent.target)
    if agent.kind == "excited":
        place = ",".join(target) if target else None
        arguments |= drawn_to(name, seed, arguments, place)
        target = ()
    frames = config.recording.frames
    with closing(open_source(name, seed, arguments, None, frames > 0)) as opened:
        try_camera(opened, frames)
    length = FOREVER if opened.live else opened.length
    body = body_of(opened, agent.kind, agent.grow)
    check_sensors(len(body.sensors))  # before anything is made of all their pairs
    zone, step = system_zone() if opened.live else None, float(name == "ros2:")
    if isinstance(opened, FileSource):
        if opened.undated:
            _logger.warning("%s: left out, times such as %s", name, opened.undated)
        zone, step = opened.zone, usual_step(opened.times)
    return _Fitted(body, arguments, target, length, opened.discrete, zone, step)


def _options(config: Config, name: str, fitted: _Fitted) -> RunOptions:
    """Return the options."""
    given = flattened(config)
    if is_live(name):
        given.setdefault("sync", _SYNC)
    if fitted.zone is not None:
        given.setdefault("zone", fitted.zone)
        if 0 < len(fitted.body.own) <= _HOME:
            given.setdefault("alarms", _ALARMS)
            given.setdefault("health_step", fitted.step)
    ends = [end for end in (config.run.ticks, fitted.length) if end is not None]
    settled = {
        "ticks": min(ends, default=None),
        "threshold": _threshold(config, fitted),
    }
    given |= {field: value for field, value in settled.items() if value is not None}
    given["cells"], given["workers"] = _cells(config, len(fitted.body.sensors))
    return RunOptions(
        source=name,
        arguments=fitted.arguments,
        body=fitted.body,
        target=fitted.target,
        **given,
    )


def _cells(config: Config, count: int) -> tuple[CellKind, int]:
    """Return where so many cells are, and in how many workers if in any."""
    table = config.cells
    workers = table.workers or min(_WORKERS, max(1, count))
    if table.kind != "auto":
        return table.kind, workers
    alone = (
        count <= FEW_CELLS
        and table.workers is None
        and config.placement.is_here
        # The machine of a home is small.
        and not isinstance(config.source, MqttTable)
    )
    return "process" if alone else "worker", workers


def _threshold(config: Config, fitted: _Fitted) -> float | str | None:
    """Return the threshold; None for the discounted snapshot's own default."""
    given: float | str | None = config.snapshot.threshold
    if given not in (None, AUTO) or config.snapshot.kind != "empirical":
        return given
    return default_threshold(fitted.body, fitted.discrete)


def _names(target: object) -> tuple[str, ...]:
    """Return a target as names, however it is written."""
    if target is None:
        return ()
    if isinstance(target, tuple):
        return target
    return tuple(name.strip() for name in str(target).split(","))


def _log(config: Config, folder: Path, source: str) -> Path | None:
    """Return where to record."""
    recording = config.recording
    if not recording.record:
        return None
    if recording.path is None:
        given = recording.folder
        return new_path(source, LOGS if given is None else folder / given)
    return free_log(folder / recording.path)


class _Judge:
    """Collects what is refused, with the keys that it is about."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self.found: list[Problem] = []

    @contextmanager
    def of(self, *tables: str) -> Iterator[None]:
        """Judge what is made of some tables; what is refused ends the block."""
        try:
            yield
        except InvalidValueError as error:
            self.found.append(self._problem(error, tables))

    def _problem(self, error: InvalidValueError, tables: tuple[str, ...]) -> Problem:
        """Return an error as a problem with the key it is about.

        It is about a key that has its name, or else a text as its value, since what
        refuses a value may know it by another name; or else about the first table.
        """
        leaves = dict(_leaves(msgspec.to_builtins(self._config), ()))
        mine = [keys for keys in [*leaves, *_keys(self._config)] if keys[0] in tables]
        for keys in _called(error.name, mine):
            return Problem(keys, error.rule, error.value)
        for keys in mine:
            value = leaves.get(keys)
            if value and isinstance(value, str) and value == error.value:
                return Problem(keys, error.rule, error.value)
        return Problem(next(_called(tables[0], mine)), str(error), UNSET)


def _keys(config: Config) -> Iterator[Keys]:
    """Return the keys that there may be, of `source` those of its kind."""
    for keys in known_keys(Config):
        if keys[0] != "source":
            yield keys
    for keys in known_keys(type(config.source)):
        yield ("source", *keys)


def _called(name: str, among: list[Keys]) -> Iterator[Keys]:
    """Return the keys that what is called so may be about, the likeliest first."""
    for last in _CALLED.get(name, (name,)):
        yield from (keys for keys in among if f".{dotted(keys)}".endswith(f".{last}"))


def _leaves(value: object, at: Keys) -> Iterator[tuple[Keys, object]]:
    """Return what stands in tables and lists, and these, with the way to it."""
    if at:
        yield at, value
    if isinstance(value, dict | tuple):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            yield from _leaves(item, (*at, key))
