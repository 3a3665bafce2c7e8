"""Publishes a run's beliefs, decisions, anomalies and the health of its sensors.

Only changes are published, each retained: a program that comes later gets the latest,
and a broker that was restarted is told again. An orderly end says ``offline`` and
leaves the rest, so that Home Assistant keeps the device with its history.
"""

import asyncio
from collections.abc import Mapping, Sequence

import msgspec

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.health.alarm import Standing
from neurosnap.sensorium import unpack
from neurosnap.sources.mqtt.connection import MqttLink
from neurosnap.sources.mqtt.options import MqttBroker, MqttPublish
from neurosnap.sources.mqtt.published_topics import (
    OFF,
    ON,
    Topics,
    beliefs,
    discovery,
    discovery_topic,
)

_ON = {True: ON.decode(), False: OFF.decode()}


class MqttPublisher:
    """Publishes one run.

    Its methods but `serve` may be called from any thread, one at a time, before `serve`
    as well; they do not wait.

    Args:
        broker: Where to.
        publish: Under which topics.
        sensors: The names of all sensors of the run, contextual ones included.
        own: How many of them, from the first on, are published; None if all are.
        actions: The names of the actions, one of which is taken at each step; none:
            nothing is decided.
        judges: Whether the health of its sensors is followed.

    Raises:
        InvalidValueError: The certificates to trust cannot be read, or the password.
    """

    def __init__(
        self,
        broker: MqttBroker,
        publish: MqttPublish,
        sensors: Sequence[str],
        *,
        own: int | None = None,
        actions: Sequence[str] = (),
        judges: bool = False,
    ) -> None:
        self._count = len(sensors)
        self._names = tuple(sensors)[:own]
        self._actions = tuple(actions)
        self._topics = Topics(publish.prefix, self._names)
        self._last: Mapping[str, object] | None = None
        self._beliefs: list[bytes | None] = [None] * len(self._names)
        self._alarms: list[str | None] = [None] * len(self._names)
        self._link = MqttLink(
            broker,
            "outlet",
            status=self._topics.status,
            second=True,  # the source's own is the first
        )
        if publish.discovery:
            found = discovery(
                publish,
                self._topics,
                self._names,
                acts=bool(actions),
                judges=judges,
            )
            self._link.hold(discovery_topic(publish), found)
        if judges:
            for topic in self._topics.health:
                self._hold_json(topic, now=_ON[False], last="")
        self.anomaly(None)

    def state(self, state: wire.State) -> None:
        """Publish what is believed by a tick's state. O(N).

        Args:
            state: What the coordinator published.

        Raises:
            ShapeError: It is the state of another number of sensors.
        """
        literals = unpack(state.literals, 2 * self._count)[: 2 * len(self._names)]
        believed = beliefs(literals)
        for topic, belief, last in zip(
            self._topics.sensors, believed, self._beliefs, strict=True
        ):
            if belief != last:  # few are, and each is a lock to take
                self._link.hold(topic, belief)
        self._beliefs = [*believed]

    def decision(self, decision_: wire.Decision) -> None:
        """Publish a decision; one that is none, where nothing is decided, is left out.

        Raises:
            InvalidValueError: There is no such choice.
        """
        choice, count = decision_.action, len(self._actions)
        if not self._actions or choice < 0:
            return
        if choice >= count:
            rule = f"must be a whole number in 0..{count - 1}"
            raise InvalidValueError("action", rule, choice)
        action = self._actions[choice]
        self._hold_json(self._topics.decision, action=action, why=decision_.why)

    def anomaly(self, record: Mapping[str, object] | None) -> None:
        """Publish that there is an anomaly now, or that there is none.

        Args:
            record: What JSON can hold; None if there is none: the last one stays to
                be looked at.
        """
        if record is not None:
            self._last = record
        now = _ON[record is not None]
        self._hold_json(self._topics.anomaly, now=now, last=self._last or {})

    def health(self, standing: Standing) -> None:
        """Publish how the sensors are; beside the others, by one thread at a time."""
        alarms = {alarm.sensor: alarm.line() for alarm in standing.alarms}
        for place, name in enumerate(self._names):
            alarm = alarms.get(name)
            if alarm != self._alarms[place]:
                last = alarm or self._alarms[place] or ""
                self._alarms[place] = alarm
                now = _ON[alarm is not None]
                self._hold_json(self._topics.health[place], now=now, last=last)
        progress = standing.progress
        self._hold_json(
            self._topics.known,
            changes=progress.activations,
            of_about=progress.of_about,
            known=progress.known,
            of=progress.sensors,
        )

    def _hold_json(self, topic: str, **said: object) -> None:
        """Let `topic` say a JSON object from now on."""
        self._link.hold(topic, msgspec.json.encode(said))

    async def serve(self, stop: asyncio.Event) -> None:
        """Publish until `stop` is set.

        Raises:
            InvalidValueError: As `MqttLink.serve`, at the start only.
            NeurosnapError: As `MqttLink.serve`, at the start only.
        """
        await self._link.serve(stop)
