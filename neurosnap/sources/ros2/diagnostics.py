"""Says what is read and believed of sensors as diagnostics of ROS 2.

There is a status for each sensor, which has one of these levels:

=========  =======================================================================
``ERROR``  an anomaly names the sensor: it is the likeliest to be wrong
``STALE``  its reading is not known
``WARN``   an anomaly can be explained by it, too; or its reading is not believed
``OK``     what is read is believed
=========  =======================================================================

and these values: what it ``reads``, what is ``believed`` of it, ``since`` which tick
all this is said of it, and ``why``: the anomaly in words.

No clock and no network: a recording gives the same messages as the run did.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from neurosnap.errors import MissingExtraError
from neurosnap.sensorium import visible
from neurosnap.sources.ros2.message_types import stock_types

ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)
_WORDS = {None: "unknown", True: "on", False: "off"}
_NANOSECONDS = 10**9
Bit: TypeAlias = bool | None


class Said(NamedTuple):
    """What is said of a sensor."""

    level: int
    message: str
    reads: str
    believed: str
    why: str = ""


def said_of(
    sensor: str, reads: Bit, believed: Bit, anomaly: Mapping[str, Any] | None = None
) -> Said:
    """Return what is said of a sensor at a tick.

    Args:
        sensor: Its name.
        reads: Its reading; None if it is not known.
        believed: What the state says of it; None if nothing.
        anomaly: That of the tick, if there is one: `culprits` and `candidates`, the
            sensors that may be wrong, and the `text`.
    """
    found = anomaly or {"culprits": (), "candidates": (), "text": ""}
    read, held = _WORDS[reads], _WORDS[believed]
    if sensor in found["culprits"]:
        wrong = "contradicts what was learned"
        return Said(ERROR, f"{read}: {wrong}", read, held, found["text"])
    why = found["text"] if sensor in found["candidates"] else ""
    if reads is None:
        more = "" if believed is None else f", believed {held}"
        return Said(STALE, f"not known{more}", read, held, why)
    if why:
        return Said(WARN, f"{read}: may contradict what was learned", read, held, why)
    if believed is not reads:
        return Said(WARN, f"{read}: not believed", read, held)
    return Said(OK, read, read, held)


class Diagnostics:
    """Follows some sensors from tick to tick.

    Args:
        sensors: Their names.

    Raises:
        MissingExtraError: `rosbags` is not installed.
    """

    def __init__(self, sensors: Sequence[str]) -> None:
        self._sensors = tuple(sensors)
        self._shown = [visible(name) for name in sensors]
        self._store = typestore()
        self._said = [Said(-1, "", "", "")] * len(self._sensors)
        self._since = [0] * len(self._sensors)

    def follow(
        self,
        tick: int,
        reads: Sequence[Bit],
        believed: Sequence[Bit],
        anomaly: Mapping[str, Any] | None = None,
    ) -> bool:
        """Take in a tick, as for `said_of`; tell whether anything else is said now."""
        said = [
            said_of(*each, anomaly)
            for each in zip(self._sensors, reads, believed, strict=True)
        ]
        if said == self._said:
            return False
        now = zip(said, self._said, self._since, strict=True)
        # An anomaly that goes on has other words each tick.
        self._since = [
            since if new[:-1] == old[:-1] else tick for new, old, since in now
        ]
        self._said = said
        return True

    def array(self, at: int) -> Any:  # noqa: ANN401 - untyped
        """Return what is said now as a message; `at` is in nanoseconds since 1970."""
        types = self._store.types
        value = types["diagnostic_msgs/msg/KeyValue"]
        status = types["diagnostic_msgs/msg/DiagnosticStatus"]
        every = [
            status(
                said.level,
                f"neurosnap: {name}",
                said.message,
                name,
                [
                    value("reads", said.reads),
                    value("believed", said.believed),
                    value("since", f"tick {since}"),
                    value("why", said.why),
                ],
            )
            for name, said, since in zip(
                self._shown, self._said, self._since, strict=True
            )
        ]
        stamp = types["builtin_interfaces/msg/Time"](*divmod(at, _NANOSECONDS))
        header = types["std_msgs/msg/Header"](stamp, "")
        return types[ARRAY](header, every)

    def message(self, at: int) -> bytes:
        """Return the same in CDR."""
        return bytes(self._store.serialize_cdr(self.array(at), ARRAY))


def typestore() -> Any:  # noqa: ANN401 - untyped
    """Return the types that come with ROS 2.

    Raises:
        MissingExtraError: `rosbags` is not installed.
    """
    try:
        return stock_types()
    except ValueError as error:
        raise MissingExtraError(f"ros2: {error}") from error
