"""One small seeded scenario for each kind of run."""

import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.policy import EXACT
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Observed, Source
from tests.golden.drive import Driven, Lost, drive, record
from tests.support.aliased_worlds import NAME as TMAZE
from tests.support.aliased_worlds import RING
from tests.support.lamp import LIMITED, lamp_options
from tests.support.run_options import options_for
from tests.support.scripted_sources import Scripted

Row = list[bool | None]
_REPEATED = (
    *(wire.WaveStart, wire.Pulse, wire.CellReport, wire.PulseBatch),
    *(wire.WorkerReport, wire.Recall, wire.Recalled, wire.Learn, wire.Learned),
)
"""What is sent again where no answer comes."""


class Scenario(msgspec.Struct, frozen=True, kw_only=True):
    """A run that is a function of what stands here."""

    name: str
    options: RunOptions
    new_source: Callable[[], Source]
    like: str = ""
    """The scenario that it must mean the same as; empty: none."""
    order: int | None = None
    """Draws the order of messages; None: first come, first served."""
    loses: int = 0
    """Of how many messages of waves and questions one is lost; 0: none is."""
    split: int = 0
    """Bytes in a file of its recording, about; 0: it is one file."""
    stored: bool = False
    """Whether its recording is stored, too."""
    dies: int = 0
    """The tick in which all die; the run is resumed. 0: none does."""

    def lost(self) -> Lost:
        """Return which messages are lost: of those that are sent again."""
        count, every = 0, self.loses

        def lost(_who: str, message: wire.Message) -> bool:
            nonlocal count
            count += isinstance(message, _REPEATED)
            return every > 0 and isinstance(message, _REPEATED) and count % every == 0

        return lost


class _Rows(Scripted):
    """Shows rows; at some ticks a trajectory begins."""

    def __init__(
        self,
        rows: Sequence[Row],
        begins: Sequence[int] = (),
        cuts: Sequence[int] = (),
    ) -> None:
        super().__init__(rows)
        self._begins, self._cuts = begins, cuts

    def _show(self, *, begins: bool = False, cut: bool = False) -> Observed | None:
        shown, tick = super()._show(begins=begins, cut=cut), self._next
        if shown is None:
            return None
        cut = tick in self._cuts
        return msgspec.structs.replace(
            shown,
            begins=tick == 1 or tick in self._begins or cut,
            cut=cut,
        )


def rows(
    ticks: int,
    seed: int,
    unknown: float = 0.0,
    breaks: Sequence[int] = (),
    rare: float = 0.0,
) -> list[Row]:
    """Draw readings of six sensors: 0 implies 1 implies 2, 3 excludes 4, 5 is noise.

    Args:
        ticks: How many.
        seed: Draws them.
        unknown: How likely each reading but the last is unknown.
        breaks: The ticks, from 1, at which 0 is on and 1 and 2 are off.
        rare: How likely that is at other ticks.
    """
    chance, table = random.Random(seed), list[Row]()
    for tick in range(1, ticks + 1):
        a, b, c, d, e, f = (chance.random() < 0.4 for _ in range(6))
        row: Row = [a, a or b, a or b or c, d, e and not d]
        if tick in breaks or chance.random() < rare:
            row[:3] = [True, False, False]
        row = [None if chance.random() < unknown else on for on in row]
        table.append([*row, f])
    return table


def _readings(
    name: str,
    table: list[Row],
    more: dict[str, Any],
    order: int | None = None,
    loses: int = 0,
    split: int = 0,
    dies: int = 0,
    stored: bool = False,
    **marks: Sequence[int],
) -> Scenario:
    """Return a run of given readings, without actions."""
    options = RunOptions(
        source="scripted",
        body=Body(own=tuple(f"s{number}" for number in range(len(table[0])))),
        ticks=len(table),
        **{"threshold": 0.06, "keyframe_every": 15, **more},
    )
    return Scenario(
        name=name,
        options=options,
        new_source=lambda: _Rows(table, **marks),
        order=order,
        loses=loses,
        split=split,
        dies=dies,
        stored=stored,
    )


def _world(name: str, options: RunOptions, **more: Any) -> Scenario:
    """Return a run of a world in which it acts."""
    given = options.source, options.seed, options.arguments
    return Scenario(
        name=name, options=options, new_source=lambda: open_source(*given), **more
    )


def _and_lossy(
    name: str, run: Callable[..., RunOptions], order: int
) -> tuple[Scenario, Scenario]:
    """Return a run inline, and the same in workers whose messages are lost at times."""
    lossy = run(cells="worker", workers=2)
    return (
        _world(name, run(cells="inline")),
        _world(f"{name}-lossy", lossy, like=name, order=order, loses=997),
    )


_DISCOUNTED = {"snapshot": "discounted", "threshold": 0.03, "decay": 0.9}
_WATCHED = {"watch": True, "support": 3, "hold": 2}
_SPREAD = {"cells": "worker", "workers": 3, "band": 4}
_GRID = {"width": 3, "height": 3}
_RAIL = {"places": 6, "target": 2}


def _path(**more: Any) -> RunOptions:
    given = {"ticks": 40, "threshold": 0.08, "keyframe_every": 7, **more}
    return options_for("neurosnap/Path-v0", 5, {"places": 8}, **given)


def _planner(**more: Any) -> RunOptions:
    given = {"agent": "planner", "ticks": 40, "threshold": 0.08, **more}
    target = ("x_below_1", "y_below_2*")
    return options_for("neurosnap/Grid-v0", 5, _GRID, target=target, **given)


def _slipping(**more: Any) -> RunOptions:
    """A run that plans by chance."""
    given = {"agent": "planner", "grow": 2, "imagine": 40, "ticks": 84, **more}
    given.setdefault("target", ("row<2*", "column<3*"))
    return options_for(
        *("neurosnap/FrozenLake-v0", 3, {"is_slippery": True}),
        threshold=EXACT,
        **given,
    )


def _preferring(**more: Any) -> RunOptions:
    """A run that does what promises most of what it prefers."""
    prefer = {"prefer": "row<2*=1,tile=hole=-5", "explore": "planned"}
    return _slipping(target=(), **prefer, **more)


def _exploring(world: str, arguments: dict[str, int], **more: Any) -> RunOptions:
    """A run that explores a world in which places look alike."""
    given = {"agent": "planner", "imagine": 30, "explore": "planned", **more}
    return options_for(world, 1, arguments, target=(), threshold=EXACT, **given)


def _latching(**more: Any) -> RunOptions:
    """A run that grows a latch."""
    return _exploring(TMAZE, {"delay": 1}, grow=4, ticks=240, **more)


def _mapping(**more: Any) -> RunOptions:
    """A run that grows the clones of a map."""
    return _exploring(RING, {"places": 6}, grow=30, ticks=345, **more)


SCENARIOS = (
    _world("cells", _path(), stored=True),
    _world("cells-any-order", _path(), like="cells", order=3),
    _world("cells-lossy", _path(), like="cells", loses=399),
    _world("workers", _path(cells="worker", workers=3), like="cells"),
    _world(
        "workers-lossy",
        _path(cells="worker", workers=3),
        like="cells",
        order=4,
        loses=149,
    ),
    _world("inline", _path(cells="inline"), like="cells"),
    _readings("derived", rows(30, 8, breaks=(20, 25)), {"wiring": "derived"}),
    _readings(
        "discounted-unknown",
        rows(90, 1, unknown=0.2, breaks=(40, 41, 42, 70)),
        _DISCOUNTED,
        begins=(20,),
        cuts=(33,),
    ),
    _readings("empirical-unknown", rows(60, 2, unknown=0.2), {"cells": "worker"}),
    _readings(
        "split-resumed", rows(80, 3, unknown=0.1), _WATCHED, split=1 << 16, dies=52
    ),
    _readings(
        "spread",
        rows(60, 4, unknown=0.1, breaks=(48, 49)),
        {**_SPREAD, **_WATCHED},
        order=5,
        loses=199,
    ),
    _readings(
        "spread-resumed-discounted",
        rows(40, 5, unknown=0.1, breaks=(34,)),
        {**_SPREAD, **_DISCOUNTED, **_WATCHED},
        dies=28,
        stored=True,
    ),
    _readings(
        "automatic-threshold",
        rows(200, 6, unknown=0.05, breaks=(150, 151), rare=0.01),
        {"threshold": "auto", "cells": "inline", "keyframe_every": 60, **_WATCHED},
    ),
    _readings(
        "anomalies",
        rows(100, 7, breaks=(50, 51, 52, 53, 80)),
        {**_WATCHED, "band": 4},
        cuts=(60,),
    ),
    _world("planner", _planner(cells="worker")),
    _world("imagining", _planner(imagine=60, cells="worker", workers=2)),
    _world("imagining-lossy", _planner(imagine=60, ticks=20), order=6, loses=997),
    _world(
        "excited",
        options_for(
            *("neurosnap/Rail-v0", 5, _RAIL),
            agent="excited",
            ticks=25,
            threshold=0.08,
            cells="worker",
        ),
    ),
    _world("growing", lamp_options(ticks=80, cells="worker", workers=2)),
    _world("growing-cells", lamp_options(ticks=36, **_WATCHED), order=7, loses=499),
    _world(
        "growing-resumed",
        lamp_options(ticks=70, cells="inline", **{**_DISCOUNTED, "threshold": 1 / 16}),
        dies=45,
        stored=True,
    ),
    _world(
        "retiring",
        msgspec.structs.replace(
            lamp_options(ticks=212, cells="inline", explore=1.0, threshold=0.05),
            imagine=0,
            target=("lit",),
        ),
    ),
    *_and_lossy("slipping", _slipping, order=8),
    *_and_lossy("preferring", _preferring, order=11),
    *_and_lossy("latching", _latching, order=9),
    *_and_lossy("mapping", _mapping, order=10),
    _world(
        "growing-cut-off",
        lamp_options(LIMITED, ticks=60, cells="inline", threshold=0.05),
    ),
)
"""What is run."""


def made(scenario: Scenario, log: Path) -> list[Driven]:
    """Make the run of a scenario, recorded at `log`; return each life of the swarm."""
    options, order, lost = scenario.options, scenario.order, scenario.lost()
    if not scenario.dies:
        whole = drive(options, scenario.new_source(), order, lost=lost)
        record(whole, options, log, split=scenario.split)
        return [whole]
    first = drive(options, scenario.new_source(), order, until=scenario.dies)
    record(first, options, log, split=scenario.split)
    files = RestartFiles(log)
    _, past = files.go_on(files.furthest(options), None)
    second = drive(options, scenario.new_source(), order, past)
    record(second, options, log, past, split=scenario.split)
    files.finish()
    return [first, second]
