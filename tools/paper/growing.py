"""Compares agents that grow sensors, plan ahead or do neither, with tabular ones."""

from collections.abc import Iterator
from typing import Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from neurosnap.sensorium import complete
from tools.paper.explorers import CHECKS, Journey, explored, journey
from tools.paper.table import Entry
from tools.paper.tabular import UPDATES, PlaceTable, follow, q_learning
from tools.paper.worlds_as_tables import Setting, Stage, stage_of

Method: TypeAlias = Literal[
    "growth and imagining",
    "imagining only",
    "growth only",
    "table",
    "Q-learning",
    "Dyna-Q",
]

_AGENTS: tuple[Method, ...] = ("growth and imagining", "imagining only", "growth only")
WHOLE, FALSE, GROWN, USED = range(4)
"""The columns of a learning curve; those of a table are moves that were tried, 0, and
twice its entries. Of values there is none: all are 0."""
KIND, NEED, STEPS, WAVES, FALLS, UNFORESEEN = range(6)
"""The columns of a journey: its kind; the fewest steps, -1 for a row that is none; the
steps taken, -1 if it did not arrive; planning waves; steps into a hole or over the
cliff, and those of them that the agent did not foresee. Of tables the last three are 0.
"""
PAIR, GOAL = range(2)
"""Kinds: any place to any; any place to the world's goal."""
SLACK = 30
"""Steps a journey may take beyond the fewest."""

_Option = TypeVar("_Option")
_Task: TypeAlias = tuple[int, int, NDArray[np.bool_]]
"""Its kind, the start, and the literals wanted."""


class GrowthEntry(Entry, frozen=True, kw_only=True):
    """One method in one world: its learning curve, and its journeys after learning."""

    VERSION = 2

    setting: Setting
    method: Method
    targets: int = 0
    """Journeys from any place to any, each of which a learner of values learns for
    anew; 0: the setting's, and those of values go to the world's goal only."""

    def row(self, run: int) -> NDArray[np.int32]:
        """Return the learning curve of a run, then its journeys.

        It is ``(checks + journeys, 6)``; a curve takes 4 columns.
        """
        stage = stage_of(self.setting)
        journeys = self.targets or self.setting.journeys
        found = np.zeros((CHECKS + journeys, 6), np.int32)
        found[CHECKS:, NEED] = -1
        (seed,) = np.random.SeedSequence(self.seed, spawn_key=(run,)).generate_state(1)
        tasks = self._tasks(stage)
        if self.method in _AGENTS:
            curve, rows = self._sent(stage, tasks, int(seed))
        else:
            curve, rows = self._tabled(stage, tasks, int(seed))
        found[: len(curve), : curve.shape[1]] = curve
        for place, (task, (need, went)) in enumerate(
            zip(tasks, rows, strict=True), CHECKS
        ):
            found[place] = task[0], need, *went
        return found

    def _tasks(self, stage: Stage) -> list[_Task]:
        most = self.targets or self.setting.journeys
        anything = self.targets or self.method not in ("Q-learning", "Dyna-Q")
        if self.setting.to_goal or not anything:
            return list(_to_goal(stage, most))
        return list(_pairs(stage, most))

    def _sent(
        self, stage: Stage, tasks: list[_Task], seed: int
    ) -> tuple[NDArray[np.int32], Iterator[tuple[int, Journey]]]:
        grows = self.method != "imagining only"
        agent, curve = explored(self.setting, seed, grows=grows)
        imagine = self.method != "growth only"

        def rows() -> Iterator[tuple[int, Journey]]:
            for number, (_, start, goal) in enumerate(tasks):
                need = _need(stage, start, goal)
                went = journey(
                    agent,
                    stage,
                    start,
                    goal,
                    need + SLACK,
                    imagine=imagine,
                    seed=number,
                )
                yield need, went

        return curve, rows()

    def _tabled(
        self, stage: Stage, tasks: list[_Task], seed: int
    ) -> tuple[NDArray[np.int32], Iterator[tuple[int, Journey]]]:
        steps, curve = self.setting.steps, np.zeros((CHECKS, 4), np.int32)
        table = PlaceTable(stage, steps, seed) if self.method == "table" else None
        if table is not None:
            every = max(1, steps // CHECKS)
            curve[:, WHOLE] = table.tried[every - 1 :: every][:CHECKS]
            curve[:, GROWN] = curve[:, USED] = curve[:, WHOLE]
        updates = UPDATES if self.method == "Dyna-Q" else 0
        learned: dict[bytes, NDArray[np.intp]] = {}

        def rows() -> Iterator[tuple[int, Journey]]:
            for number, (_, start, goal) in enumerate(tasks):
                need, at = _need(stage, start, goal), _at(stage, goal)
                if at.tobytes() not in learned or self.targets:
                    learned[at.tobytes()] = (
                        q_learning(stage, at, steps, seed + number, updates)
                        if table is None
                        else table.policy(at)
                    )
                choice = learned[at.tobytes()]
                went = follow(stage, choice, start, at, need + SLACK, number)
                yield need, Journey(went, 0, 0, 0)

        return curve, rows()


def _at(stage: Stage, goal: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return at which places all literals of a goal hold: ``(places,)``."""
    held: NDArray[np.bool_] = np.logical_and.reduce(stage.fields[goal[::2]])
    held &= ~stage.fields[goal[1::2]].any(axis=0)
    return held


def _need(stage: Stage, start: int, goal: NDArray[np.bool_]) -> int:
    return int(stage.distances(_at(stage, goal))[start])


def _pairs(stage: Stage, most: int) -> Iterator[_Task]:
    """Yield journeys from place to place, drawn if there are too many."""
    pairs = []
    for place in range(len(stage.over)):
        goal = complete(stage.fields[:, place])
        far = stage.distances(_at(stage, goal))
        starts = np.flatnonzero(~stage.over & (far > 0) & np.isfinite(far))
        pairs += [(start, place) for start in starts.tolist()]
    for start, place in _drawn(pairs, most):
        yield PAIR, start, complete(stage.fields[:, place])


def _to_goal(stage: Stage, most: int) -> Iterator[_Task]:
    """Yield journeys to the world's goal; what holds at all of it is wanted."""
    fields = stage.fields[:, stage.goals]
    goal = np.zeros(2 * len(fields), np.bool_)
    goal[::2], goal[1::2] = fields.all(axis=1), ~fields.any(axis=1)
    far = stage.distances(_at(stage, goal))
    starts = np.flatnonzero(~stage.over & (far > 0) & np.isfinite(far))
    for start in _drawn(starts.tolist(), most):
        yield GOAL, start, goal


def _drawn(options: list[_Option], most: int) -> list[_Option]:
    if len(options) <= most:
        return options
    drawn = np.random.default_rng(0).choice(len(options), most, replace=False)
    return [options[k] for k in sorted(drawn.tolist())]
