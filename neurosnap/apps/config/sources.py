"""TOML tables of sources, one struct per `kind`.

Another kind is another struct in `SourceTable`: its `kind` is its tag, and `opening`
says how it is opened.
"""

from pathlib import Path
from typing import Annotated, TypeAlias

import msgspec

from neurosnap.sources.live.tick_schedule import Seconds, TickRule
from neurosnap.sources.mqtt.options import MqttOptions
from neurosnap.sources.open import MQTT, ROS2, STDIN, ZENOH
from neurosnap.sources.protocol import Argument
from neurosnap.sources.ros2.options import Ros2Options

Text: TypeAlias = Annotated[str, msgspec.Meta(min_length=1)]
Opening: TypeAlias = tuple[str, dict[str, Argument]]
"""The name and the arguments that `neurosnap.sources.open.open_source` takes."""


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind"):
    """What sources that end have in common."""


class WorldTable(_Table, frozen=True, kw_only=True, tag="world"):
    """A Gymnasium environment."""

    id: Text
    """Its id, `neurosnap/Path-v0`; `module:Id` imports a module first."""
    arguments: dict[str, Argument] = {}
    """What it is made with."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened; a world is the same from any folder."""
        return self.id, dict(self.arguments)


class FileTable(_Table, frozen=True, kw_only=True, tag="file"):
    """A file of readings, or the folder of a bag."""

    path: Text
    """Where it is."""
    arguments: dict[str, Argument] = {}
    """Which sensors are read, and how: `sensors`, `when`, `time`, `bins`, `every`."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened, by its path from `folder`."""
        return str(folder / self.path), dict(self.arguments)


class _LiveTable(TickRule, frozen=True):
    """What sources that are fed from outside have in common."""

    sensors: tuple[Text, ...] = ()
    """The sensors, in order: names, or conditions such as `level > 20`."""
    stale_after: Seconds | None = None
    """Seconds after which a reading is believed no more; left out: it always is."""

    def _arguments(self) -> dict[str, Argument]:
        fields = msgspec.structs.fields(self)
        given = {field.name: getattr(self, field.name) for field in fields}
        if names := given.pop("sensors"):
            names = msgspec.json.encode(names).decode()
        usual = {field.name: field.default for field in fields}
        said = {name: each for name, each in given.items() if each != usual[name]}
        return ({"sensors": names} if names else {}) | said


class StdinTable(_LiveTable, frozen=True, tag_field="kind", tag="stdin"):
    """Standard input, a JSON object a line; the first names the signals, if need be."""

    bins: Annotated[int, msgspec.Meta(ge=0)] = 4
    """Parts that the range of a number is cut into; 0: none is."""
    stretch: Seconds = 600.0
    """Seconds, at most, in which the ranges of numbers are learned first."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened; it is the same from any folder."""
        return STDIN, self._arguments()


class ZenohTable(_LiveTable, frozen=True, tag_field="kind", tag="zenoh"):
    """Any program that publishes readings with Zenoh, under the swarm's own keys."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened; it is the same from any folder."""
        return ZENOH, self._arguments()


class MqttTable(MqttOptions, frozen=True, tag_field="kind", tag="mqtt"):
    """Topics of an MQTT broker."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened; its files are looked for from `folder`."""
        files = {
            name: str(folder / path)
            for name in ("ca_file", "password_file")
            if (path := getattr(self.broker, name)) is not None
        }
        broker = msgspec.structs.replace(self.broker, **files)
        options = msgspec.structs.replace(self, broker=broker)
        return MQTT, {"options": msgspec.json.encode(options).decode()}


class Ros2Table(Ros2Options, frozen=True, tag_field="kind", tag="ros2"):
    """Topics of a graph of ROS 2 whose nodes use `rmw_zenoh_cpp`."""

    def opening(self, folder: Path) -> Opening:
        """Return how it is opened; its files are looked for from `folder`."""
        files = tuple(str(folder / file) for file in self.msg_files)
        options = msgspec.structs.replace(self, msg_files=files)
        return ROS2, {"options": msgspec.json.encode(options).decode()}


SourceTable: TypeAlias = (
    WorldTable | FileTable | StdinTable | ZenohTable | MqttTable | Ros2Table
)
"""What may stand under `[source]`."""
