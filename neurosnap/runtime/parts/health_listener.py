"""Follows the health of a run's sensors, and hands what is new to an outlet."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import NeurosnapError
from neurosnap.health.follower import Follower, Said
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.recording.read.observed import Observed, as_observed, observations
from neurosnap.recording.read.split_files import first_path, open_whole

if TYPE_CHECKING:
    from neurosnap.health.alarm import Progress
    from neurosnap.sources.mqtt.publisher import MqttPublisher

_logger = logging.getLogger(__name__)


class HealthListener:
    """Tells an outlet which sensors are in alarm. Used by one thread at a time.

    It keeps no state of its own: after a restart it reads what is recorded again.

    Args:
        publisher: Publishes it.
        body: What is sensed.
        alarms: The budget, such as ``1/week``.
    """

    def __init__(self, publisher: "MqttPublisher", body: Body, alarms: str) -> None:
        self._publisher = publisher
        self._body = body
        self._follower = Follower(body.own, alarms)
        self._progress: Progress | None = None
        self._lines: dict[str, str] = {}  # of the sensors in alarm

    def catch_up(self, past: ResumePoint) -> None:
        """Follow what is recorded by now. A millisecond or so for each ten minutes."""
        log = Path(past.log)
        first = first_path(log, past.part) if past.part else log
        try:
            for tick, observed in observations(open_whole(first)):
                if tick > past.tick:
                    break
                self._follow(observed)
        except (NeurosnapError, OSError) as error:
            _logger.warning("health: learned from a part of the recording: %s", error)
        self._tell()

    def take(self, message: wire.Observation, sent: int) -> None:
        """Take in an observation, sent so many nanoseconds after 1970.

        Raises:
            ShapeError: It is of another number of sensors.
        """
        self._follow(as_observed(message, sent, self._body))
        self._tell()

    def _follow(self, observed: Observed) -> None:
        at, on, known, begins = observed
        said: Said = self._follower.observe(on, known, at, begins=begins)
        for name, _ in said.ended:
            self._lines.pop(name, None)
        self._lines |= {alarm.sensor: alarm.line() for alarm in said.begun}

    def _tell(self) -> None:
        """Publish what is not as it was."""
        self._publisher.health(self._lines)
        progress = self._follower.monitor.progress
        if progress != self._progress:
            self._progress = progress
            self._publisher.health_known(progress)
