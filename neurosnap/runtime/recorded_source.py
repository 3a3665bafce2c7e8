"""The source of a run: which of its options are recorded, and how it is reopened.

What a recording or a coordinator says is data. It decides nothing that this machine
connects to, reads or imports, but for worlds of ours and standard input.
"""

import re
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import TypeAlias

import msgspec
from msgspec.structs import replace

from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.fit_agent import body_of
from neurosnap.sources.camera import try_camera
from neurosnap.sources.open import (
    MQTT,
    ROS2,
    STDIN,
    as_in_run,
    is_file,
    is_live,
    mqtt_options,
    open_source,
    ros2_options,
)
from neurosnap.sources.protocol import Argument

Trust: TypeAlias = tuple[str, Mapping[str, Argument]] | bool
"""A source as the user names it, with its arguments; or whether any may be opened."""
_OURS = re.compile(r"neurosnap/\w+-v\d+")


def recordable(options: RunOptions) -> RunOptions:
    """Return options as others may see them: without the places of secrets.

    Nor with the first lines of standard input, which have their ticks.
    """
    if options.source != MQTT:
        given = {k: v for k, v in options.arguments.items() if k != "head"}
        return replace(options, arguments=given)
    mqtt = mqtt_options(options.arguments)
    broker = replace(mqtt.broker, password_file=None, password_env=None)
    said = msgspec.json.encode(replace(mqtt, broker=broker)).decode()
    return replace(options, arguments={"options": said})


def reopened(options: RunOptions, trusts: Trust) -> tuple[RunOptions, int | None]:
    """Return the options of a run with the source to open, and its length.

    Args:
        options: From a recording, or from a coordinator.
        trusts: What may be opened; a harmless source always, also with the arguments
            in `options`.

    Raises:
        InvalidValueError: A word from the user is needed; or what the user names is
            not the run's, or cannot be opened.
    """
    source, arguments = options.source, options.arguments
    if not (trusts or _is_harmless(source)):
        rule = "must be named again (a world, a file, or the TOML file of the run), or"
        what = f"come with --trust-source, as the recording would {_effect(options)}"
        raise InvalidValueError("source", f"{rule} {what}", source)
    if isinstance(trusts, tuple):
        source, given = trusts
        # Which sensors are read of a file that the user names is harmless, too.
        if given or not (_is_harmless(source) or is_file(source)):
            # Where it is cut was learned by the run, and is not learned again.
            arguments = as_in_run(source, given, arguments)
    if Path(source).name != Path(options.source).name:
        raise InvalidValueError("source", f"must be {options.source!r} here", source)
    if not is_live(source) and arguments != options.arguments:
        rule = f"must be named here, too, as {options.arguments!r:.500}"
        raise InvalidValueError("arguments", rule, arguments)
    opened = open_source(source, options.seed, arguments, None, options.frames > 0)
    with closing(opened):
        try_camera(opened, options.frames)
    plain = replace(options.body, room=0, grown=())
    if body_of(opened, options.agent) != plain:
        rule = "must have the sensors and actions of the run"
        raise InvalidValueError("source", rule, source)
    return replace(options, source=source, arguments=arguments), opened.length


def _is_harmless(source: str) -> bool:
    return source == STDIN or bool(_OURS.fullmatch(source) and not is_file(source))


def _effect(options: RunOptions) -> str:
    """Return what it does to open a source, for people."""
    name, arguments = options.source, options.arguments
    if name == MQTT:
        broker = mqtt_options(arguments).broker
        more = f"username {broker.username!r}, ca_file {broker.ca_file!r}"
        return f"connect to the broker {broker.address!r} ({more})"
    if name == ROS2:
        given = ros2_options(arguments)
        read = f" and read {', '.join(given.msg_files)}" if given.msg_files else ""
        return f"connect to the router {given.router!r}{read}"
    if is_live(name):
        return "take readings from Zenoh"
    what = "read the file" if is_file(name) else "import and run the world"
    return f"{what} {name!r} with {arguments!r:.500}"
