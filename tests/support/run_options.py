"""Options of runs, with the sensors and actions that their sources have."""

from collections.abc import Mapping

from neurosnap.agent.body import Body
from neurosnap.agent.policy import AgentKind
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.fit_agent import body_of
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Argument


def options_for(
    source: str,
    seed: int,
    arguments: Mapping[str, Argument] | None = None,
    *,
    agent: AgentKind = "walker",
    grow: int = 0,
    **more: object,
) -> RunOptions:
    """Return the options of a run.

    Args:
        source: As in `open_source`, like the next two.
        seed: Draws everything.
        arguments: Of a world.
        agent: What chooses the actions; a planner goes where the second sensor is on
            and the first is off.
        grow: How many sensors it may grow.
        **more: Any other options.
    """
    given = dict(arguments or {})
    opened = open_source(source, seed, given)
    opened.close()
    if agent == "planner":
        more.setdefault("target", (opened.sensors[1], f"{opened.sensors[0]}*"))
    return RunOptions(
        source=source,
        arguments=given,
        body=body_of(opened, agent, grow),
        agent=agent,
        seed=seed,
        **more,  # type: ignore[arg-type]
    )


def core_options(sensors: int, workers: int = 0, **more: object) -> RunOptions:
    """Return the options of a coordinator's core that is tested without a source.

    Args:
        sensors: How many there are; of a `body` that is given, it does not matter.
        workers: How many share the cells; if 0, every cell is a part.
        **more: Any other options.
    """
    given: dict[str, object] = {
        "body": Body(own=tuple(f"s{number}" for number in range(sensors))),
        "cells": "worker" if workers else "process",
        "workers": workers,
        "keyframe_every": 1000,
    }
    return RunOptions(source="none", **(given | more))  # type: ignore[arg-type]
