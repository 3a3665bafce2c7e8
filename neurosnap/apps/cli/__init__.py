"""The command line: parses arguments, calls the library and prints results.

With --format json the last line is JSON. Exit codes: 0 all well, 1 failed, 2 wrong
usage, 3 finished but something was lost.

The module of a verb is imported when the verb is called: to import all takes half a
second, and the help and the version need none.
"""

from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from neurosnap.system.distribution import version

_PANELS = {
    "Learn": {
        "run": "Learn from a world, a file or live sensors, and record everything.",
        "resume": "Continue a run after its last whole tick, in a new recording.",
        "learn": "Report which sensors imply which, in readings or in a recording.",
        "compare": "Report whether a machine changed: what differs between two"
        " recordings of it.",
        "health": "Report which sensors of a home or a machine seem broken, since when,"
        " and why.",
    },
    "Recordings": {
        "info": "Show what a recording holds, and what is missing from it.",
        "verify": "Derive a run again from its observations, and compare bit for bit.",
        "play": "Publish a recording over Zenoh again, as it was when it was recorded.",
        "export": "Convert a recording to a table, a page or a bag, or save what is"
        " intact of it.",
        "depth": "Measure how far a wave of messages travels, and how long that takes.",
    },
    "Watch": {
        "watch": "Show anomalies, observations that contradict what was learned, and"
        " alarms.",
        "view": "Show recordings, or swarms while they run, in the browser.",
    },
    "Swarms": {
        "ps": "List the swarms that run on this machine.",
        "stop": "End a swarm of this machine in order, with its recording finished.",
        "serve": "Start a part of a swarm by hand, on this machine: its hub, world,"
        " recorder, cells or coordinator.",
    },
    "Set up": {
        "check": "Find all that would keep a run from starting, with line numbers.",
        "init": "Write what a swarm begins with: a TOML file from a broker's topics, or"
        " keys.",
        "ros2": "Listen to the robots of ROS 2.",
    },
}
"""The verbs and what they do, by panels of the help, in its order."""
_MODULES = {
    "resume": "run",
    **dict.fromkeys(("compare", "health"), "learn"),
    **dict.fromkeys(("info", "verify", "play", "export"), "recordings"),
    **dict.fromkeys(("view", "ps", "stop"), "watch"),
    "check": "init",
}
"""Where verbs are that have no module of their own name."""


class _Verbs(TyperGroup):
    """The verbs, each imported when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401 - typer's
        return [verb for panel in _PANELS.values() for verb in panel]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401 - typer's
        if cmd_name in self.list_commands(ctx) and cmd_name not in self.commands:
            import_module(f"{__name__}.{_MODULES.get(cmd_name, cmd_name)}")
            self.commands.update(typer.main.get_group(app).commands)
        return self.commands.get(cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401
        verbs = self.list_commands(ctx)
        if args and args[0] not in verbs:  # what is like it is suggested
            for verb in verbs:
                self.get_command(ctx, verb)
        return super().resolve_command(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - typer's
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        records = (one.get_help_record(ctx) for one in self.get_params(ctx))
        with formatter.section("Options"):
            formatter.write_dl([one for one in records if one])
        for panel, verbs in _PANELS.items():
            with formatter.section(panel):
                formatter.write_dl([*verbs.items()], col_max=8)


app = typer.Typer(
    name="neurosnap",
    cls=_Verbs,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"neurosnap {version()}")
        raise typer.Exit


@app.callback()
def _main(
    _version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_print_version,
            is_eager=True,
            metavar="",
            help="Print the version.",
        ),
    ] = False,
) -> None:
    """A distributed snapshot memory: one process per sensor, exchanging messages."""
