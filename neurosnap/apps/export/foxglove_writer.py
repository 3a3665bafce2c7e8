"""Writes the exported MCAP file: channels and messages."""

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec
from mcap.writer import Writer

from neurosnap import wire
from neurosnap.apps.export import foxglove_schemas as drawn
from neurosnap.apps.export.foxglove_layout import BELIEVED, GRAPH, LOG, READINGS, STATE
from neurosnap.recording.format import schemas
from neurosnap.recording.read.file import Recorded
from neurosnap.system.distribution import version

COPIED = (
    *("observe", "state", "reach", "decide", "anomaly", "fault", "leave"),
    "image",
)
"""What is said once a tick or less, as it was recorded."""


class Sink:
    """Writes messages in JSON, each on its channel; to be left by `with`.

    Args:
        path: What is there is replaced.
        sensors: The names of the run's sensors.

    Raises:
        OSError: It cannot be written.
    """

    def __init__(self, path: Path, sensors: Sequence[str]) -> None:
        self._file = path.open("wb")
        self._mcap = Writer(self._file)
        # No profile: that of a recording promises that nothing in it is derived.
        self._mcap.start("", f"neurosnap {version()}")
        self._channels: dict[str, int] = {}
        for topic in COPIED:
            message = wire.TOPICS[topic]
            name, schema = schemas.name(message), schemas.encoded(message)
            self._channels[f"/{topic}"] = self._channel(f"/{topic}", name, schema)
        signs = drawn.signs(sensors)
        log, scene = drawn.foxglove(drawn.LOG), drawn.foxglove(drawn.SCENE)
        for topic, name, schema in (
            (READINGS, drawn.SIGNS, signs),
            (BELIEVED, drawn.SIGNS, signs),
            (LOG, drawn.LOG, log),
            (GRAPH, drawn.SCENE, scene),
            (STATE, drawn.SCENE, scene),
        ):
            self._channels[topic] = self._channel(topic, name, schema)

    def _channel(self, topic: str, name: str, schema: bytes) -> int:
        number = self._mcap.register_schema(name, schemas.ENCODING, schema)
        return self._mcap.register_channel(topic, "json", number)

    def copy(self, recorded: Recorded) -> None:
        """Write a message as it was recorded, if it is one of `COPIED`.

        Raises:
            OSError: The disk does not take it.
        """
        channel = self._channels.get(f"/{wire.topic(recorded.message.key)}")
        if channel is not None:
            _, payload, sequence, sent, log_time = recorded
            self._mcap.add_message(channel, log_time, payload, sent, sequence)

    def put(self, topic: str, message: object, time: int) -> None:
        """Write a derived message.

        Args:
            topic: One of those in `neurosnap.apps.export.foxglove_layout`.
            message: What can be JSON.
            time: That of what it is derived from, nanoseconds since the epoch.

        Raises:
            OSError: The disk does not take it.
        """
        payload = msgspec.json.encode(message)
        self._mcap.add_message(self._channels[topic], time, payload, time)

    def attach(self, name: str, data: bytes) -> None:
        """Attach a JSON file.

        Raises:
            OSError: The disk does not take it.
        """
        self._mcap.add_attachment(0, 0, name, "application/json", data)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._file:
            if error is None:
                self._mcap.finish()
