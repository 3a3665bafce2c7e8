"""Figure 5: where greedy planning fails, and which agents still arrive."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.system.picture import FEW, QUANTITY, ink_on
from tools.paper.figure import Claim, Figure, FigureOptions, Report
from tools.paper.obstacles import (
    ARRIVED,
    BLOCKED,
    FIRST,
    AgentName,
    Arena,
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
_COLOURS = {"excited": FEW[0], "greedy": FEW[1], "random": FEW[2]}
_MARKERS = {"excited": "o", "greedy": "s", "random": "^"}

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
            "first",
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
    world = arena(cell.world, cell.target)
    distance = np.where(world.reached(cell.goal), 0.0, np.inf)
    for _ in range(len(distance)):
        distance = np.minimum(distance, 1 + distance[world.moves].min(axis=0))
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
        shortest = _shortest(cell)
        actions = arena(cell.world, cell.target).body.actions
        for run, starts in enumerate(found.tolist()):
            for start, (steps, blocked, first) in enumerate(starts):
                yield (
                    cell.world,
                    cell.agent,
                    run,
                    start,
                    int(shortest[start]),
                    steps if steps >= 0 else "",
                    blocked,
                    actions[first] if first >= 0 else "",
                )


def _draw(canvas: "Canvas", results: Results) -> None:
    canvas.set_size_inches(9, 8)
    panels = canvas.subplots(2, 2)
    maps: tuple[tuple[str, AgentName], ...] = (
        (_GRID, "greedy"),
        (_PUNCTURED, "greedy"),
        (_PUNCTURED, "excited"),
    )
    titles = (
        "whole grid, greedy planning",
        "punctured grid, greedy planning",
        "punctured grid, excitation-driven",
    )
    image: Any = None
    for axes, key, title in zip(panels.flat, maps, titles, strict=False):
        cell, found = results[key]
        image = _map(axes, arena(cell.world, cell.target), found)
        axes.set_title(title, fontsize="medium")
    canvas.colorbar(image, ax=panels, label="share of runs that arrive", shrink=0.5)
    _rail(panels[1, 1], results)
    canvas.suptitle("Obstructions to greedy planning, with perfect exposure beforehand")


def _map(axes: "Axes", world: Arena, found: NDArray[np.int32]) -> object:
    """Draw from where an agent arrives, and what it does first."""
    x, y = world.coordinates.T
    shares = (found[:, :, ARRIVED] >= 0).mean(axis=0)
    size = x.max() + 1, y.max() + 1
    picture = np.full(size[::-1], np.nan)
    picture[y, x] = shares
    _missing(axes, picture)
    image = axes.imshow(picture, origin="lower", vmin=0, vmax=1, cmap=QUANTITY)
    for start in range(len(x)):
        firsts = found[:, start, FIRST]
        firsts = firsts[firsts >= 0]
        if not firsts.size:
            continue
        action = int(np.bincount(firsts).argmax())
        turn = _direction(world, action)
        red, green, blue = np.asarray(image.to_rgba(shares[start]))[:3].tolist()
        if turn is not None:
            axes.quiver(
                x[start],
                y[start],
                *turn,
                angles="xy",
                pivot="mid",
                scale=16,
                width=0.008,
                color=ink_on((red, green, blue)),
            )
    goal = int(np.argmin(world.distances))
    axes.plot(x[goal], y[goal], "*", color="white", mec="black", ms=15)
    axes.set(
        xlabel="x", ylabel="y", xticks=range(0, size[0], 5), yticks=range(0, size[1], 5)
    )
    return image


def _missing(axes: "Axes", picture: NDArray[np.float64]) -> None:
    """Cross out the places that the world lacks: black is a colour of the map's end."""
    for y, x in np.argwhere(np.isnan(picture)).tolist():
        for way in (0.5, -0.5):
            axes.plot([x - 0.5, x + 0.5], [y - way, y + way], color="black", lw=1.2)


def _direction(world: Arena, action: int) -> tuple[float, float] | None:
    """Return where an action leads on the map; None: it stays."""
    steps = world.coordinates[world.moves[action]] - world.coordinates
    moving = steps[(steps != 0).any(axis=1)]
    if not moving.size:
        return None
    dx, dy = moving[0].tolist()
    return float(dx), float(dy)


def _rail(axes: "Axes", results: Results) -> None:
    agents: tuple[AgentName, ...] = ("greedy", "random", "excited")
    shortest = _shortest(results[_RAIL, "greedy"][0])
    ways = np.unique(shortest)
    for agent in agents:
        cell, found = results[_RAIL, agent]
        steps = np.where(found[:, :, ARRIVED] >= 0, found[:, :, ARRIVED], cell.limit)
        means = [steps[:, shortest == way].mean() for way in ways]
        line = f"{_MARKERS[agent]}-"
        axes.plot(ways, means, line, ms=4, color=_COLOURS[agent], label=agent)
    axes.plot(ways, ways, "--", color="0.6", label="shortest way")
    axes.set_yscale("symlog", linthresh=1)
    axes.set_xticks(range(0, int(ways[-1]) + 1, 2))
    axes.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    axes.set(xlabel="shortest way to the target (steps)", ylabel="steps taken, mean")
    axes.set_title("circular rail (never arriving counts as 400)", fontsize="medium")
    axes.grid(alpha=0.25)
    axes.legend(fontsize="small", frameon=False)


FIGURE = Figure(
    name="obstructions",
    title="Obstructions to greedy planning",
    cells=cells,
    report=report,
)
"""Figure 5 ([GK] "A Punctured Grid", "Agent on a Circular Rail")."""
