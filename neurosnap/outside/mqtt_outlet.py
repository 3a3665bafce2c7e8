"""What a run publishes of itself: beliefs, predictions, decisions, anomalies.

Only changes are published, each retained: whoever comes later is told how things are,
and a broker that was restarted is told again. An orderly end says ``offline`` and
leaves the rest, so that Home Assistant keeps the device with its history; with
`MqttPublish.forget` all of it is taken back.
"""

import asyncio
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.outside.mqtt_discovery import discovery, discovery_topic
from neurosnap.outside.mqtt_link import MqttLink
from neurosnap.outside.mqtt_options import MqttBroker, MqttPublish
from neurosnap.outside.mqtt_topics import (
    Topics,
    anomaly,
    beliefs,
    decision,
    predictions,
)
from neurosnap.sensorium import unpack


class MqttOutlet:
    """Publishes one run.

    The methods that take something in may be called from any thread, before `serve` as
    well; they do not wait.

    Args:
        broker: Where to.
        publish: Under which topics.
        sensors: The names of all sensors of the run, contextual ones included.
        own: How many of them, from the first on, are published; None: all.
        actions: The names of the atomic actions; none: nothing is decided.
        exclusive: Exactly one of them is taken at each step.

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
        exclusive: bool = True,
    ) -> None:
        self._publish = publish
        self._count = len(sensors)
        self._names = tuple(sensors)[:own]
        self._actions = tuple(actions)
        self._exclusive = exclusive
        self._topics = Topics(publish.prefix, self._names)
        self._last: Mapping[str, object] | None = None
        self._link = MqttLink(broker, "outlet", status=self._topics.status)
        if publish.discovery:
            found = discovery(publish, self._topics, self._names, acts=bool(actions))
            self._link.hold(discovery_topic(publish), found)
        self.anomaly(None)

    def state(self, state: wire.State, known: NDArray[np.bool_] | None = None) -> None:
        """Take in a tick's state. O(N).

        Args:
            state: What the coordinator published.
            known: ``(N,)``: which sensors were read at that tick; None: all.

        Raises:
            ShapeError: It is the state of another number of sensors, or `known` is.
        """
        literals = unpack(state.literals, 2 * self._count)[: 2 * len(self._names)]
        if known is not None:
            known = known[: len(self._names)]
        said = predictions(self._names, literals, known)
        for topic, belief in zip(self._topics.sensors, beliefs(literals), strict=True):
            self._link.hold(topic, belief)
        self._link.hold(self._topics.predictions, said)

    def decision(self, decision_: wire.Decision) -> None:
        """Take in a decision; one that is none, where nothing is decided, is left out.

        Raises:
            InvalidValueError: There is no such choice.
        """
        if self._actions and decision_.action >= 0:
            said = decision(self._named(decision_.action), decision_.why)
            self._link.hold(self._topics.decision, said)

    def anomaly(self, record: Mapping[str, object] | None) -> None:
        """Take in that there is an anomaly now, or that there is none.

        Args:
            record: What JSON can hold; None: there is none, and the last one stays to
                be looked at.
        """
        if record is not None:
            self._last = record
        said = anomaly(record is not None, self._last)
        self._link.hold(self._topics.anomaly, said)

    async def serve(self, stop: asyncio.Event) -> None:
        """Publish until `stop` is set.

        Raises:
            InvalidValueError: As `MqttLink.serve`, at the start only.
            NeurosnapError: As `MqttLink.serve`, at the start only.
        """
        await self._link.serve(stop, forget=self._publish.forget)

    def _named(self, choice: int) -> str:
        """Return what a choice is called."""
        count = len(self._actions)
        most = count if self._exclusive else 2**count
        if choice >= most:
            rule = f"must be a whole number in 0..{most - 1}"
            raise InvalidValueError("action", rule, choice)
        if self._exclusive:
            return self._actions[choice]
        taken = [name for k, name in enumerate(self._actions) if choice >> k & 1]
        return " + ".join(taken) or "none"
