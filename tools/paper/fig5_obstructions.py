"""Figure 5: where greedy planning fails, and which agents still arrive."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tools.paper.figure import Claim, Figure, FigureOptions, Report
from tools.paper.obstacles import (
    ARRIVED,
    BLOCKED,
    AgentName,
    ObstacleEntry,
    arena,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_MOST_RUNS = 5  # agents step by step: a run takes seconds
_LIMIT = 400
_GRID, _PUNCTURED, _RAIL = (
    "neurosnap/Grid-v0",
    "neurosnap/PuncturedGrid-v0",
    "neurosnap/Rail-v0",
)
# Above the middle of the grid, where the hole is; and across the rail from place 0.
_ABOVE = ("x_below_6", "x_below_5*", "y_below_10", "y_below_9*")
_TASKS: tuple[tuple[str, AgentName, int, tuple[str, ...]], ...] = (
    (_GRID, "greedy", 104, _ABOVE),
    (_PUNCTURED, "greedy", 103, _ABOVE),
    (_PUNCTURED, "excited", 103, _ABOVE),
    (_RAIL, "greedy", 12, ("near_12",)),
    (_RAIL, "excited", 12, ("near_12",)),
    (_RAIL, "random", 12, ("near_12",)),
)

Results = Mapping[tuple[str, AgentName], tuple[ObstacleEntry, NDArray[np.int32]]]


def cells(options: FigureOptions) -> list[ObstacleEntry]:
    """Return the agents and worlds of the figure."""
    return [
        ObstacleEntry(
            world=world,
            agent=agent,
            target=target,
            goal=goal,
            limit=_LIMIT,
            runs=min(options.runs, _MOST_RUNS),
            seed=options.seed,
        )
        for world, agent, target, goal in _TASKS
    ]


def report(options: FigureOptions, rows: Sequence[NDArray[Any]]) -> Report:
    """Return the figure of the rows of its cells."""
    pairs = zip(cells(options), rows, strict=True)
    results = {(cell.world, cell.agent): (cell, found) for cell, found in pairs}
    return Report(
        columns=(
            "world",
            "agent",
            "run",
            "start",
            "shortest",
            "steps",
            "blocked",
        ),
        rows=_table(results),
        draw=lambda canvas: _draw(canvas, results),
        claims=claims(results),
        lines=tuple(_line(*result) for result in results.values()),
    )


def claims(results: Results) -> tuple[Claim, ...]:
    """Hold the counts against the paper's text.

    [GK] "Obstructions to Greedy Reactive Planning".
    """
    counts = {key: _summary(*result) for key, result in results.items()}
    whole, holed = counts[_GRID, "greedy"], counts[_PUNCTURED, "greedy"]
    drawn = counts[_PUNCTURED, "excited"]
    rail = {agent: counts[_RAIL, agent] for agent in ("greedy", "excited", "random")}
    return (
        Claim(
            "without an obstacle greedy planning takes a shortest way from everywhere",
            whole["arrived"] == 1 and whole["mean_steps"] == whole["mean_shortest"],
            f"{whole['arrived']:.0%} arrive, in {whole['mean_steps']:.3g} steps on"
            f" average; the shortest ways take {whole['mean_shortest']:.3g}",
            steps=0,
        ),
        Claim(
            "in the punctured grid the agent attempts to move to the missing vertex and"
            " fails",
            holed["arrived"] < 1 and holed["blocked"] > 0,
            f"{holed['arrived']:.0%} arrive in {_LIMIT} steps;"
            f" {holed['blocked']:.0f} attempts a run, none in the whole grid"
            if whole["blocked"] == 0
            else f"{whole['blocked']:.0f} attempts in the whole grid, too",
            steps=0,
        ),
        Claim(
            "on the circular rail no action is guaranteed to help, so planning comes to"
            " no more than chance (it takes at least half as long as a random walk, or"
            " never arrives)",
            rail["greedy"]["arrived"] < 1
            or rail["greedy"]["mean_steps"] >= rail["random"]["mean_steps"] / 2,
            ", ".join(
                f"{agent} {each['arrived']:.0%} in {each['mean_steps']:.3g} steps"
                for agent, each in rail.items()
            ),
            steps=0,
        ),
        Claim(
            "a graded signal overcomes both: excitation-driven agents arrive from"
            " everywhere",
            drawn["arrived"] == rail["excited"]["arrived"] == 1,
            f"{drawn['arrived']:.0%} in the punctured grid,"
            f" {rail['excited']['arrived']:.0%} on the rail",
            steps=0,
        ),
    )


def _summary(cell: ObstacleEntry, found: NDArray[np.int32]) -> dict[str, Any]:
    steps = found[:, :, ARRIVED]
    there = steps >= 0
    shortest = np.broadcast_to(_shortest(cell), steps.shape)
    return {
        "world": cell.world,
        "agent": cell.agent,
        "arrived": float(there.mean()),
        "mean_steps": float(steps[there].mean()) if there.any() else np.nan,
        "mean_shortest": float(shortest[there].mean()) if there.any() else np.nan,
        "blocked": float(found[:, :, BLOCKED].sum(axis=1).mean()),
    }


def _shortest(cell: ObstacleEntry) -> NDArray[np.float64]:
    """Return the fewest steps from each place to the goal: ``(places,)``."""
    known = arena(cell.world, cell.target)
    distance = np.where(known.reached(cell.goal), 0.0, np.inf)
    for _ in range(len(distance)):
        distance = np.minimum(distance, 1 + distance[known.world.moves].min(axis=0))
    return distance


def _line(cell: ObstacleEntry, found: NDArray[np.int32]) -> str:
    facts = _summary(cell, found)
    name = cell.world.removeprefix("neurosnap/").removesuffix("-v0")
    if np.isnan(facts["mean_steps"]):
        return f"{name}, {cell.agent}: none arrive"
    return (
        f"{name}, {cell.agent}: {facts['arrived']:.0%} of the starts arrive, in"
        f" {facts['mean_steps']:.3g} steps (shortest {facts['mean_shortest']:.3g});"
        f" {facts['blocked']:.3g} blocked attempts a run"
    )


def _table(results: Results) -> Iterator[Sequence[object]]:
    for cell, found in results.values():
        shortest = _shortest(cell).astype(int).tolist()
        for run, starts in enumerate(found.tolist()):
            for start, (steps, blocked) in enumerate(starts):
                arrived = steps if steps >= 0 else ""
                head = cell.world, cell.agent, run, start
                yield *head, shortest[start], arrived, blocked


def _draw(canvas: "Canvas", results: Results) -> None:
    canvas.set_size_inches(11, 5)
    left, right = canvas.subplots(1, 2)
    cell, found = results[_PUNCTURED, "greedy"]
    world = arena(cell.world, cell.target).world
    x, y = world.coordinates.T
    shares = np.full((y.max() + 1, x.max() + 1), np.nan)
    shares[y, x] = (found[:, :, ARRIVED] >= 0).mean(axis=0)
    image = left.imshow(shares, origin="lower", vmin=0, vmax=1)
    goal = int(np.argmin(world.distances))
    left.plot(x[goal], y[goal], "*", color="white", mec="black", ms=15)
    canvas.colorbar(image, ax=left, label="share of runs that arrive")
    left.set(xlabel="x", ylabel="y")
    left.set_title("punctured grid (white: the hole), greedy planning", fontsize=10)
    _rail(right, results)
    canvas.suptitle("Obstructions to greedy planning, with perfect exposure beforehand")


def _rail(axes: "Axes", results: Results) -> None:
    """Draw the mean of the steps taken against the fewest, for each agent."""
    shortest = _shortest(results[_RAIL, "greedy"][0])
    ways = np.unique(shortest)
    agents: tuple[AgentName, ...] = ("greedy", "random", "excited")
    for agent, line in zip(agents, ("s-", "^-", "o-"), strict=True):
        cell, found = results[_RAIL, agent]
        steps = np.where(found[:, :, ARRIVED] >= 0, found[:, :, ARRIVED], cell.limit)
        means = [steps[:, shortest == way].mean() for way in ways]
        axes.plot(ways, means, line, ms=4, label=agent)
    axes.plot(ways, ways, "--", color="0.6", label="shortest way")
    axes.set_yscale("symlog", linthresh=1)
    axes.set(xlabel="shortest way to the target (steps)", ylabel="steps taken, mean")
    axes.set_title(f"circular rail (never arriving counts as {_LIMIT})", fontsize=10)
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)


FIGURE = Figure(
    name="obstructions",
    title="Obstructions to greedy planning",
    cells=cells,
    report=report,
)
"""Figure 5 ([GK] "A Punctured Grid", "Agent on a Circular Rail")."""
