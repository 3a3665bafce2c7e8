"""The alarms about broken sensors in a recorded run, found again from its readings."""

from collections.abc import Iterator

from neurosnap.health.budget import NEVER
from neurosnap.health.follower import Follower
from neurosnap.health.news import News, news
from neurosnap.recording.read.observed import observations
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.run_facts import options_of


def alarms_of(recording: Recording) -> Iterator[tuple[int, News]]:
    """Yield the alarms of a run by its own budget, and their ends, each after its tick.

    Raises:
        RecordingError: While iterating: the recording is damaged, or not a run's.
    """
    options = options_of(recording)
    if options.alarms == NEVER:
        return
    follower = Follower(options.body.own, options.alarms)
    before = follower.standing
    for tick, (at, on, known, begins) in observations(recording):
        follower.observe(on, known, at, begins=begins)
        now = follower.standing
        for each in news(before, now):
            yield tick, each
        before = now
