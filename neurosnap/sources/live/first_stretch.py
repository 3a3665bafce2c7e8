"""Listens to a live source before its run, to learn the range of each signal.

Nothing else is learned of what comes meanwhile, and nothing of it is kept. The cuts
that are chosen are fixed with it, and recorded with the run.
"""

import logging
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import closing

from neurosnap.errors import InvalidValueError
from neurosnap.sources.conditions import Condition, Signals
from neurosnap.sources.cuts import Signal, cut_by
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import Feeder, LiveSource
from neurosnap.sources.live.tick_schedule import OnChange
from neurosnap.sources.message_fields import Term
from neurosnap.sources.wanted import Wanted

_STEPS = 10  # times that it says how far it is
_logger = logging.getLogger(__name__)


class Ranges:
    """Takes in what signals say, and makes no readings of it.

    Args:
        wanted: Which signals are taken.

    Attributes:
        heard: What each said that is taken by itself, in the order they came.
    """

    def __init__(self, wanted: Wanted) -> None:
        self.signals: tuple[str, ...] = ()
        self.heard: dict[str, Signal] = {}
        self._wanted, self._terms = wanted, wanted.terms()
        self._lock = threading.Lock()

    @property
    def are_plain(self) -> bool:
        """All that was heard says on and off by itself."""
        return all(signal.is_plain for signal in self.heard.values())

    def wants(self, name: str) -> bool:
        """Return whether a signal is wanted: it is not known yet."""
        return True

    def terms(self, topic: str) -> list[Term]:
        """Return the signals that are terms of a topic's messages."""
        return [term for term in self._terms if term.is_of(topic)]

    def read(
        self, values: Mapping[str, object], topic: str = ""
    ) -> tuple[dict[str, bool | None], list[InvalidValueError]]:
        """Take in what signals say; of a topic, if it is one."""
        with self._lock:
            for name, value in values.items():
                if self._wanted.takes(name, topic=topic):
                    signal = self.heard.setdefault(name, Signal())
                    if value not in signal.seen:
                        signal.add(value, learned=True)
        return {}, []

    def chosen(self, names: Sequence[str] = ()) -> Signals:
        """Return how signals are read; conditions are there whatever was heard.

        Args:
            names: Of signals that stand first, be they read or not.

        Raises:
            InvalidValueError: Something is named that said nothing.
        """
        wanted = cut_by(self._wanted, self.heard, lenient=True)
        cuts = wanted.cuts or {}
        found: dict[str, tuple[Condition | None, ...]] = dict.fromkeys(names, ())
        for name in self.heard:
            if some := cuts.get(name, (None,)):
                found[name] = some
        for each in wanted.conditions:
            found[each.source] = (*found.get(each.source, ()), each)
        if not any(found.values()):
            rule = "must say something on and off, numbers or few words meanwhile"
            raise InvalidValueError("source", rule, "nothing")
        return found


def listen(feeder: Feeder, ranges: Ranges, seconds: float) -> None:
    """Let a feeder hand in what it hears, for so long or until its source has ended.

    Raises:
        NeurosnapError: What the feeder failed of.
    """
    # No reading of its sensor comes, so that it has no tick.
    latest = LatestReadings(["-"])
    source = LiveSource(latest, OnChange(), feeder=feeder)
    source.readers = ranges
    source.over = True  # nothing need be kept for a process that goes on with it
    end = time.monotonic() + seconds
    with ThreadPoolExecutor(1) as pool, closing(source):
        heard = pool.submit(source.first)
        for step in range(_STEPS):
            said = _progress(seconds * step / _STEPS, seconds)
            _logger.warning("learning the range: %s", said)
            until = end - seconds * (_STEPS - 1 - step) / _STEPS
            if wait([heard], max(0.0, until - time.monotonic())).done:
                heard.result()  # it has ended, or failed
                return


def _progress(done: float, seconds: float) -> str:
    """Return how far it is.

    Examples:
        >>> _progress(240, 600), _progress(3, 30)
        ('4 of 10 minutes', '3 of 30 seconds')
    """
    unit, name = (60, "minutes") if seconds >= 120 else (1, "seconds")
    return f"{done / unit:g} of {seconds / unit:g} {name}"
