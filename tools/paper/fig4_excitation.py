"""Figure 4: distance of excitation-driven agents from their targets.

Every agent starts with an empty snapshot, at a place and with a target drawn for its
run. Start, target, fields and random numbers are functions of the seed, the setting and
the run, so both snapshots face the same tasks with the same luck.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.policies import new_policy
from neurosnap.agent.policy import EXPLORE
from neurosnap.sources.gymnasium_source import import_worlds
from neurosnap.system.picture import FEW
from tools.paper import learners
from tools.paper.figure import Claim, Figure, FigureOptions, Report
from tools.paper.learning_error import new_snapshot
from tools.paper.table import Entry
from tools.paper.walks import SETTINGS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_DECAY = learners.DECAYS[4]
_END = 0  # the place at one end of the path
_BINS = 90
_SINCE = (1000, 4000)  # steps from which on means are told
_COLOURS = {None: FEW[0], _DECAY: FEW[1]}
_TITLES = {
    "path": "path, thresholds",
    "cycle": "cycle, beacons",
    "grid": "grid, thresholds",
    "random": "path, random fields (dotted: target at its end)",
}


@dataclass(frozen=True)
class Task:
    """A world, a place to start from and one to get to."""

    moves: NDArray[np.intp]
    """``(actions, places)``; where an action leads."""
    fields: NDArray[np.bool_]
    """``(N, places)``; where each sensor is on."""
    distances: NDArray[np.float64]
    """``(places,)``; how far each place is from the target, in actions."""
    start: int
    seed: int
    """Of the agent."""
    body: Body


class TargetEntry(Entry, frozen=True, kw_only=True):
    """An excitation-driven agent in a setting; its runs are one entry of the table."""

    VERSION = 3
    steps: int
    """Observations in each run."""
    setting: str
    """The setting's name."""
    threshold: float
    """``tau`` of every pair."""
    decay: float | None
    """``q`` of a discounted snapshot; None: it is empirical."""
    explore: float
    """The share of random actions where nothing better than `worse*` is guaranteed."""
    target: int | None
    """The place to get to; None: one is drawn for every run."""

    @property
    def name(self) -> str:
        """What people see of it in a listing of files."""
        kind = "empirical" if self.decay is None else "discounted"
        to = "" if self.target is None else f"-to-{self.target}"
        return f"excited-{kind}-{self.setting}{to}"

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of a row: ``(steps,)``."""
        return (self.steps,)

    def row(self, run: int) -> NDArray[np.uint16]:
        """Return the distance to the target at each observation of a run."""
        todo = task(self.setting, self.seed, run, self.target)
        policy = new_policy("excited", todo.body, todo.seed, explore=self.explore)
        snapshot = new_snapshot(self.threshold, self.decay, len(todo.body.sensors))
        agent = Agent(todo.body, policy, snapshot)
        far = np.empty(self.steps, np.uint16)
        place = before = todo.start
        for step in range(self.steps):
            now, then = todo.distances[[place, before]]
            far[step] = now
            drives = now < then, now > then
            action = agent.act(np.append(todo.fields[:, place], drives)).action
            before, place = place, int(todo.moves[action, place])
        return far


def task(name: str, seed: int, run: int, target: int | None = None) -> Task:
    """Return what an agent is to do in one run of a setting.

    Args:
        name: The setting's.
        seed: From 0 up.
        run: From 0 up.
        target: The place to get to; None: one is drawn.
    """
    key = (list(SETTINGS).index(name), run, 1)  # not the streams of the random walks
    reset, agent = np.random.SeedSequence(seed, spawn_key=key).generate_state(2)
    import_worlds()
    env: gymnasium.Env[Any, Any] = gymnasium.make(
        SETTINGS[name].world, target="drawn" if target is None else target
    )
    try:
        _, info = env.reset(seed=int(reset))
        get = env.get_wrapper_attr
        return Task(
            moves=get("moves"),
            fields=get("fields"),
            distances=get("distances"),
            start=info["place"],
            seed=int(agent),
            body=Body.full(get("sensors"), get("actions"), get("orders")),
        )
    finally:
        env.close()


def guaranteed(todo: Task) -> float:
    """Return at what share of the places but the target the truth guarantees better.

    That is where some sensation ``a`` of the place and some action lead nearer to the
    target from *every* place at which ``a`` holds ([GK] "Closing the Loop": what has to
    be verified for the true poc set). Where there is none, no agent that knows the
    truth, and nothing but the truth, has anything to go by.
    """
    literals = np.concatenate([todo.fields, ~todo.fields])
    nearer = todo.distances[todo.moves] < todo.distances
    # (actions, literals): no place has the literal and is not brought nearer.
    sound = ~(~nearer[:, np.newaxis] & literals[np.newaxis]).any(axis=2)
    helped = (sound.any(axis=0)[:, np.newaxis] & literals).any(axis=0)
    away = todo.distances > 0
    return float(helped[away].mean())


def cells(options: FigureOptions) -> list[TargetEntry]:
    """Return an empirical and a discounted agent a setting, settings outermost.

    Targets are drawn. With random fields, most targets have nothing around them that
    would tell on which side of them one is; so there agents whose target is the end of
    the path come after.
    """
    return [
        TargetEntry(
            setting=name,
            threshold=learners.LEAST,
            decay=decay,
            explore=EXPLORE,
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
        name: [guaranteed(task(name, options.seed, run)) for run in range(options.runs)]
        for name in SETTINGS
    }
    return Report(
        columns=("setting", "decay", "target", "step", "mean", "std", "min", "max"),
        rows=_table(courses),
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


def _summary(cell: TargetEntry, distances: NDArray[Any]) -> dict[str, Any]:
    means = distances.mean(axis=0)
    return {
        "setting": cell.setting,
        "threshold": cell.threshold,
        "decay": cell.decay,
        "target": cell.target,
        "explore": cell.explore,
        "mean_since": {
            str(since): float(means[since - 1 :].mean())
            for since in _SINCE
            if since <= cell.steps
        },
        "within_one": float((distances[:, -1] <= 1).mean()),
    }


def _line(cell: TargetEntry, distances: NDArray[Any]) -> str:
    facts = _summary(cell, distances)
    since = ", ".join(
        f"{mean:.3g} from step {step} on" for step, mean in facts["mean_since"].items()
    )
    kind = "empirical" if cell.decay is None else "discounted"
    return (
        f"{cell.setting}, {kind}{_towards(cell)}: {facts['within_one']:.0%} of runs end within 1 of the"
        f" target; mean distance {since or f'{distances.mean():.3g}'}"
    )


def _towards(cell: TargetEntry) -> str:
    return "" if cell.target is None else f", target {cell.target}"


def _table(
    courses: Sequence[tuple[TargetEntry, NDArray[Any]]],
) -> Iterator[Sequence[object]]:
    for cell, distances in courses:
        head = (
            cell.setting,
            "" if cell.decay is None else repr(cell.decay),
            "drawn" if cell.target is None else cell.target,
        )
        columns = zip(
            distances.mean(axis=0).tolist(),
            distances.std(axis=0).tolist(),
            distances.min(axis=0).tolist(),
            distances.max(axis=0).tolist(),
            strict=True,
        )
        for step, (mean, std, least, most) in enumerate(columns, 1):
            yield *head, step, f"{mean:.6g}", f"{std:.6g}", least, most


def _draw(
    canvas: "Canvas", courses: Sequence[tuple[TargetEntry, NDArray[Any]]]
) -> None:
    canvas.set_size_inches(10, 7)
    panels = canvas.subplots(2, 2, sharex=True, sharey=True)
    for axes, setting in zip(panels.flat, SETTINGS.values(), strict=True):
        axes.set_title(f"({setting.letter}) {_TITLES[setting.name]}", fontsize="medium")
        for cell, distances in courses:
            if cell.setting == setting.name:
                _stroke(axes, cell, distances)
        axes.grid(alpha=0.25, lw=0.6)
    steps, runs = courses[0][0].steps, courses[0][0].runs
    first = panels.flat[0]
    first.set_xscale("log")
    first.set_xlim(1, max(2, 1.15 * steps))
    first.set_yscale("symlog", linthresh=0.02, linscale=0.3)
    first.set_ylim(bottom=0)
    ticks = [0, 0.1, 0.3, 1, 3, 10]
    first.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    first.yaxis.set_minor_locator(_nothing())
    for axes in panels[1]:
        axes.set_xlabel("step (observations)")
    for axes in panels[:, 0]:
        axes.set_ylabel("distance to the target (actions)")
    handles, labels = first.get_legend_handles_labels()
    canvas.legend(
        handles, labels, loc="outside lower center", ncols=len(labels), frameon=False
    )
    canvas.suptitle(
        f"Excitation-driven agents: mean and quartiles of {runs} runs that begin"
        " with an empty snapshot"
    )


def _nothing() -> Any:  # noqa: ANN401 - matplotlib is imported late
    from matplotlib.ticker import NullLocator

    return NullLocator()


def _stroke(axes: "Axes", cell: TargetEntry, distances: NDArray[Any]) -> None:
    # On a logarithmic scale late steps lie too dense to be seen one by one.
    edges = (
        np.unique(np.geomspace(1, cell.steps, _BINS, endpoint=False).astype(np.intp))
        - 1
    )
    widths = np.diff(np.append(edges, cell.steps))
    binned = np.add.reduceat(distances.astype(np.float64), edges, axis=1) / widths
    steps = edges + (widths + 1) / 2
    low, high = np.percentile(binned, (25, 75), axis=0)
    colour = _COLOURS[cell.decay]
    label = "empirical" if cell.decay is None else r"discounted, $q = 1 - 2^{-6}$"
    if cell.target is None:
        axes.fill_between(steps, low, high, color=colour, alpha=0.15, lw=0)
    style = "-" if cell.target is None else ":"
    axes.plot(steps, binned.mean(axis=0), style, color=colour, lw=1.1, label=label)


FIGURE = Figure(
    name="agents-excited",
    title="Excitation-driven agents",
    cells=cells,
    report=report,
)
"""Figure 4 ([GK] fig:sniffy)."""
