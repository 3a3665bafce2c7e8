"""Figure 4: distance of excitation-driven agents from their targets.

Every agent starts with an empty snapshot, at a place and with a target drawn for its
run. Start, target, fields and random numbers are functions of the seed, the setting and
the run, so both snapshots face the same tasks with the same luck.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.policy import EXPLORE
from neurosnap.agent.policy_kinds import new_policy
from tools.paper import learners
from tools.paper.figure import STEPWISE, Claim, Figure, FigureOptions, Report, stepwise
from tools.paper.learning_error import new_snapshot
from tools.paper.plots import Stroke, draw
from tools.paper.table import Entry
from tools.paper.walks import SETTINGS, World, world_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_DECAY = learners.DECAYS[4]
_END = 0  # the place at one end of the path
_SINCE = (1000, 4000)  # steps from which on means are told


class TargetEntry(Entry, frozen=True, kw_only=True):
    """An excitation-driven agent in a setting; its runs are one entry of the table."""

    VERSION = 4
    steps: int
    """Observations in each run."""
    setting: str
    """The setting's name."""
    decay: float | None
    """``q`` of a discounted snapshot; None: it is empirical."""
    target: int | None
    """The place to get to; None: one is drawn for every run."""

    def row(self, run: int) -> NDArray[np.uint16]:
        """Return the distance to the target at each observation of a run."""
        world, seed = task(self.setting, self.seed, run, self.target)
        policy = new_policy("excited", world.body, seed, explore=EXPLORE)
        snapshot = new_snapshot(learners.LEAST, self.decay, len(world.body.sensors))
        agent = Agent(world.body, policy, snapshot)
        places = [world.place] * 2
        for _ in range(self.steps):
            action = agent.act(world.sense(places[-1], places[-2])).action
            places.append(int(world.moves[action, places[-1]]))
        return world.distances[places[1:-1]].astype(np.uint16)


def task(
    name: str, seed: int, run: int, target: int | None = None
) -> tuple[World, int]:
    """Return what an agent is to do in one run of a setting, and the agent's seed.

    Args:
        name: The setting's.
        seed: From 0 up.
        run: From 0 up.
        target: The place to get to; None: one is drawn.
    """
    key = (list(SETTINGS).index(name), run, 1)  # not the streams of the random walks
    reset, agent = np.random.SeedSequence(seed, spawn_key=key).generate_state(2)
    to = "drawn" if target is None else target
    return world_of(SETTINGS[name].world, int(reset), target=to), int(agent)


def guaranteed(todo: World) -> float:
    """Return at what share of the places but the target the truth guarantees better.

    That is where some sensation ``a`` of the place and some action lead nearer to the
    target from *every* place at which ``a`` holds ([GK] "Closing the Loop": what has to
    be verified for the true poc set). Where there is none, no agent that knows the
    truth, and nothing but the truth, has anything to go by.
    """
    literals = np.concatenate([todo.fields, ~todo.fields])
    far = todo.distances
    nearer = far[todo.moves] < far
    # (actions, literals): no place has the literal and is not brought nearer.
    sound = ~(~nearer[:, np.newaxis] & literals[np.newaxis]).any(axis=2)
    helped = (sound.any(axis=0)[:, np.newaxis] & literals).any(axis=0)
    return float(helped[far > 0].mean())


def cells(options: FigureOptions) -> list[TargetEntry]:
    """Return an empirical and a discounted agent a setting, settings outermost.

    Targets are drawn. With random fields, most targets have nothing around them that
    would tell on which side of them one is; so there agents whose target is the end of
    the path come after.
    """
    return [
        TargetEntry(
            setting=name,
            decay=decay,
            target=target,
            runs=options.runs,
            steps=options.steps,
            seed=options.seed,
        )
        for name, target in (*((name, None) for name in SETTINGS), ("random", _END))
        for decay in (None, _DECAY)
    ]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    courses = list(zip(cells(options), rows, strict=True))
    truths = {
        name: [
            guaranteed(task(name, options.seed, run)[0]) for run in range(options.runs)
        ]
        for name in SETTINGS
    }
    return Report(
        columns=("setting", "decay", "target", *STEPWISE),
        rows=stepwise(map(_head, cells(options)), rows),
        draw=lambda canvas: _draw(canvas, courses),
        claims=claims(courses, truths),
        lines=tuple(_line(cell, distances) for cell, distances in courses),
    )


def claims(
    courses: Sequence[tuple[TargetEntry, NDArray[Any]]],
    truths: dict[str, list[float]],
) -> tuple[Claim, ...]:
    """Hold the distances against the paper's text ([GK] "Closing the Loop")."""
    sure = [name for name in ("path", "cycle", "grid") if min(truths[name]) == 1]
    arrived = {
        (cell.setting, cell.decay is None): float((distances[:, -1] <= 1).mean())
        for cell, distances in courses
        if cell.target is None
    }
    least = min(share for (name, _), share in arrived.items() if name != "random")
    return (
        Claim(
            "in (a)-(c) every place but the target has a sensation and an action that"
            " lead nearer from wherever it is sensed (share of places, least of runs)",
            len(sure) == 3,
            ", ".join(
                f"({s.letter}) {min(truths[s.name]):.3g}, mean"
                f" {np.mean(truths[s.name]):.3g}"
                for s in SETTINGS.values()
            ),
            steps=0,
        ),
        Claim(
            "the strategy gives agents in (a)-(c) the exposure they need to capture the"
            " target (every run ends within distance 1 of it)",
            least == 1,
            ", ".join(
                f"{name} {'empirical' if plain else 'discounted'} {share:.0%}"
                for (name, plain), share in arrived.items()
            ),
        ),
    )


def _line(cell: TargetEntry, distances: NDArray[Any]) -> str:
    means = distances.mean(axis=0)
    since = ", ".join(
        f"{means[step - 1 :].mean():.3g} from step {step} on"
        for step in _SINCE
        if step <= cell.steps
    )
    kind = "empirical" if cell.decay is None else "discounted"
    to = "" if cell.target is None else f", target {cell.target}"
    return (
        f"{cell.setting}, {kind}{to}: {(distances[:, -1] <= 1).mean():.0%} of runs end"
        f" within 1 of the target; mean distance {since or f'{means.mean():.3g}'}"
    )


def _head(cell: TargetEntry) -> tuple[object, ...]:
    """Return the columns of the CSV that say what a row is of."""
    decay = "" if cell.decay is None else repr(cell.decay)
    return cell.setting, decay, "drawn" if cell.target is None else cell.target


def _draw(
    canvas: "Canvas", courses: Sequence[tuple[TargetEntry, NDArray[Any]]]
) -> None:
    strokes = [
        Stroke(
            cell.setting,
            "empirical" if cell.decay is None else r"discounted, $q = 1 - 2^{-6}$",
            "#004488" if cell.decay is None else "#bb5566",
            distances,
            band=cell.target is None,
            style="-" if cell.target is None else ":",
        )
        for cell, distances in courses
    ]
    title = (
        f"Excitation-driven agents: mean and quartiles of {courses[0][0].runs} runs"
        " (dotted: the target is the end of the path)"
    )
    draw(canvas, strokes, title, "distance to the target (actions)", 0.02)


FIGURE = Figure(
    name="agents-excited",
    title="Excitation-driven agents",
    cells=cells,
    report=report,
)
"""Figure 4 ([GK] fig:sniffy)."""
