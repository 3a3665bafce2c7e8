"""The evidence against each signal, step by step.

How unlikely a signal's levels are in a step, by all others, is ``log(1 + q)``, with
the `q` of `neurosnap.health.level_model` for each of its features. Its mean over the
last steps counts, with weights that fall exponentially, over 4 steps, 16, 64 and so on:
a short one finds at once what is glaring, a long one what is faint.

How far that goes while nothing is wrong is told by its peaks, the largest value in each
stretch of four times as many steps. They are of steps that the regression had not
learned when it judged them, so they are as large as they are going to be.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.level_model import FEATURES, LATELY, Mask
from neurosnap.system.compiled import njit

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Counts = NDArray[np.int64]
WINDOWS = np.array([4, 16, 64, 256, 1024, 4096])
"""Steps that evidence is taken over."""
STRETCH = 4
"""How many times as long a stretch is that has one peak."""
TOP = 20
"""The peaks that tell how far evidence goes: so many, the largest."""
TURN = 0.5
"""By how much a level changes that turns, from one step to the next."""
_LATELY, _FORGOTTEN = 50.0, 8.0
"""Steps that the mean of the levels lately is over, and in which it is forgotten while
the signal is in alarm."""


class LevelEvidence(NamedTuple):
    """The evidence up to now. ``W`` windows, ``S`` signals, ``N`` sensors."""

    lately: Floats
    """``(N,)``, the mean of the last levels of each sensor."""
    mean: Floats
    """``(W, S)``, the evidence."""
    began: Counts
    """``(W, S)``, the step after the last at which it was as usual."""
    read: Floats
    """``(W, N)``, the mean level of each sensor."""
    guessed: Floats
    """``(W, N)``, the mean of what all others say it should have been."""
    apart: Floats
    """``(W, N)``, the mean of how far it was from that."""
    known: Floats
    """``(W, N)``, for which share of the time each was known."""
    calm: Counts
    """``(S,)``, for how many steps the evidence has been as usual."""
    odd: Counts
    """``(S,)``, the last step at which it was not."""
    turns: Counts
    """``(S,)``, how often its sensors turned meanwhile."""
    last: Floats
    """``(N,)``, the last level of each sensor."""

    @classmethod
    def none(cls, signals: int, sensors: int) -> "LevelEvidence":
        """Return none; it begins with the first step."""
        windows = len(WINDOWS)
        return cls(
            np.full(sensors, np.nan),
            np.zeros((windows, signals)),
            np.zeros((windows, signals), np.int64),
            np.zeros((windows, sensors)),
            np.zeros((windows, sensors)),
            np.zeros((windows, sensors)),
            np.ones((windows, sensors)),
            np.zeros(signals, np.int64),
            np.zeros(signals, np.int64),
            np.zeros(signals, np.int64),
            np.zeros(sensors),
        )


class Levels(NamedTuple):
    """What sensors read in some steps."""

    on: Floats
    """``(T, N)``, for which share of the time at which it was known each was on."""
    known: Floats
    """``(T, N)``, for which share of the step each was known."""


class Moments(NamedTuple):
    """Sums of features and of their products, about the first there were."""

    steps: Counts
    """``(1,)``."""
    about: Floats
    """``(D,)``."""
    sums: Floats
    """``(D,)``."""
    products: Floats
    """``(D, D)``, the lower half."""

    @classmethod
    def none(cls, sensors: int) -> "Moments":
        """Return those of no step."""
        size = sensors * FEATURES
        return cls(
            np.zeros(1, np.int64),
            np.zeros(size),
            np.zeros(size),
            np.zeros((size, size)),
        )

    def mean(self) -> Floats:
        """Return the mean of each feature."""
        return np.asarray(self.about + self.sums / self.steps[0])

    def covariance(self) -> Floats:
        """Return the covariance of all features."""
        mean = self.sums / self.steps[0]
        lower = np.tril(self.products / self.steps[0] - np.outer(mean, mean))
        return np.asarray(lower + np.tril(lower, -1).T)


class Peaks(NamedTuple):
    """How far evidence went in a time that one regression judged."""

    steps: Counts
    """``(W,)``, of the stretch under way."""
    now: Floats
    """``(W, S)``, the most in it."""
    top: Floats
    """``(W, S, TOP + 1)``, the largest peaks, falling."""
    stretches: Counts
    """``(W,)``, how many are over."""

    @classmethod
    def none(cls, signals: int) -> "Peaks":
        """Return those of no step."""
        windows = len(WINDOWS)
        return cls(
            np.zeros(windows, np.int64),
            np.zeros((windows, signals)),
            np.zeros((windows, signals, TOP + 1)),
            np.zeros(windows, np.int64),
        )


class Bounds(NamedTuple):
    """Where evidence is told, and where it is as usual."""

    alarm: Floats
    """``(W, S)``, more than which is an alarm."""
    usual: Floats
    """``(W, S)``, no more than which is nothing."""
    bad: Flags
    """``(S,)``, the signals in alarm, by which no other is judged."""
    learned: Flags
    """``(S,)``, the signals that are learned from."""
    ends: Counts
    """``(S,)``, after how many calm steps an alarm ends."""
    turns: Counts
    """``(S,)``, how often its sensors must have turned in them."""
    within: Counts
    """``(S,)``, over how many of the windows it has to be calm."""


@njit(nogil=True)
def features_of(on: Floats, known: Floats, lately: Floats, made: Floats) -> None:
    """Write the features of a step.

    Args:
        on: ``(N,)``, the level of each sensor; any where it is unknown.
        known: ``(N,)``, for which share of the step each is known.
        lately: ``(N,)``, updated.
        made: ``(D,)``, written; not a number where unknown.
    """
    for s in range(on.shape[0]):
        if known[s] > 0:
            if np.isnan(lately[s]):
                lately[s] = on[s]
            lately[s] += (on[s] - lately[s]) / _LATELY
        made[s * FEATURES] = on[s] if known[s] > 0 else np.nan
        made[s * FEATURES + 1] = lately[s] if known[s] > 0 else np.nan
        made[s * FEATURES + 2] = known[s]


@njit(nogil=True)
def learn_step(features: Floats, left_out: Flags, moments: Moments) -> None:
    """Learn from a step.

    What is unknown, or left out, counts as the mean.

    Args:
        features: ``(D,)``, not a number where unknown.
        left_out: ``(N,)``, sensors that are not learned from.
        moments: Updated.
    """
    steps, about, sums, products = moments
    row = np.empty(about.shape[0])
    for i in range(row.shape[0]):
        if np.isnan(features[i]) or left_out[i // FEATURES]:
            row[i] = sums[i] / max(steps[0], 1)
        else:
            if steps[0] == 0:
                about[i] = features[i]
            row[i] = features[i] - about[i]
    steps[0] += 1
    for i in range(row.shape[0]):
        sums[i] += row[i]
        for j in range(i + 1):
            products[i, j] += row[i] * row[j]


@njit(nogil=True)
def learn(levels: Levels, lately: Floats, moments: Moments) -> None:
    """Learn from steps, and judge none of them."""
    features = np.empty(moments.about.shape[0])
    none = np.zeros(lately.shape[0], np.bool_)
    for t in range(levels.on.shape[0]):
        features_of(levels.on[t], levels.known[t], lately, features)
        learn_step(features, none, moments)


@njit(nogil=True)
def note_levels(
    sensor: int, read: float, missed: float, evidence: LevelEvidence
) -> None:
    """Take note of what a sensor read, and by how much it missed the guess."""
    for w in range(WINDOWS.shape[0]):
        share = 1.0 / WINDOWS[w]
        for mean, value in (
            (evidence.read[w], read),
            (evidence.guessed[w], read - missed),
            (evidence.apart[w], abs(missed)),
        ):
            mean[sensor] += (value - mean[sensor]) * share


@njit(nogil=True)
def judge(
    features: Floats, mask: Mask, learned: Flags, evidence: LevelEvidence
) -> None:
    """Add a step to the evidence.

    Of a signal in alarm the mean lately is drawn to what all others would have it: what
    it read in a fault would speak against it long after.

    Args:
        features: ``(D,)``, not a number where unknown.
        mask: What is judged by; it leaves out what is unknown.
        learned: ``(S,)``, the signals that are learned from.
        evidence: Updated.
    """
    far = np.zeros(features.shape[0])
    deviations = np.where(np.isnan(features), 0.0, features - mask.mean)
    for i in range(far.shape[0]):
        for j in range(far.shape[0]):
            far[i] += mask.rows[i, j] * deviations[j]
    for signal in range(mask.sizes.shape[0]):
        low = mask.bounds[signal] * FEATURES
        high = mask.bounds[signal + 1] * FEATURES
        unlikely = 0.0
        for i in range(low, high):
            missed = 0.0
            for j in range(low, high):
                missed += mask.blocks[i, j] * far[j]
            unlikely += far[i] * missed
            sensor, feature = i // FEATURES, i % FEATURES
            if feature == LATELY and not (learned[signal] or np.isnan(features[i])):
                evidence.lately[sensor] -= missed / _FORGOTTEN
            if feature == 0 and not np.isnan(features[i]):
                note_levels(sensor, features[i], missed, evidence)
                turned = abs(features[i] - evidence.last[sensor]) >= TURN
                evidence.turns[signal] += turned
                evidence.last[sensor] = features[i]
        said = np.log1p(unlikely / mask.sizes[signal])
        for w in range(WINDOWS.shape[0]):
            evidence.mean[w, signal] += (said - evidence.mean[w, signal]) / WINDOWS[w]


@njit(nogil=True)
def note_peaks(evidence: Floats, counted: Flags, peaks: Peaks) -> None:
    """Take note of how far the evidence of a step goes, of some signals."""
    for w in range(WINDOWS.shape[0]):
        peaks.steps[w] += 1
        over = peaks.steps[w] >= STRETCH * WINDOWS[w]
        for s in range(counted.shape[0]):
            if counted[s]:
                peaks.now[w, s] = max(peaks.now[w, s], evidence[w, s])
            if over:
                place = TOP
                while place > 0 and peaks.top[w, s, place - 1] < peaks.now[w, s]:
                    peaks.top[w, s, place] = peaks.top[w, s, place - 1]
                    place -= 1
                if peaks.top[w, s, place] < peaks.now[w, s]:
                    peaks.top[w, s, place] = peaks.now[w, s]
                peaks.now[w, s] = 0.0
        if over:
            peaks.steps[w] = 0
            peaks.stretches[w] += 1


@njit(nogil=True)
def is_well(signal: int, evidence: LevelEvidence, bounds: Bounds) -> bool:
    """Return whether an alarm about a signal is over."""
    turned = evidence.turns[signal] >= bounds.turns[signal]
    return bool(turned and evidence.calm[signal] >= bounds.ends[signal])


@njit(nogil=True)
def is_news(number: int, evidence: LevelEvidence, bounds: Bounds) -> bool:
    """Return whether an alarm begins or ends, and since when evidence is odd."""
    news = False
    for s in range(bounds.bad.shape[0]):
        calm = True
        for w in range(WINDOWS.shape[0]):
            if evidence.mean[w, s] <= bounds.usual[w, s]:
                evidence.began[w, s] = number + 1
            elif w < bounds.within[s]:
                calm = False
            if evidence.mean[w, s] > bounds.alarm[w, s] and not bounds.bad[s]:
                news = True
        evidence.calm[s] += 1
        if not calm:
            evidence.calm[s] = evidence.turns[s] = 0
            evidence.odd[s] = number
        if bounds.bad[s] and is_well(s, evidence, bounds):
            news = True
    return news


@njit(nogil=True)
def follow(
    number: int,
    levels: Levels,
    mask: Mask,
    bounds: Bounds,
    evidence: LevelEvidence,
    moments: Moments,
    peaks: Peaks,
) -> int:
    """Go on by some steps, until an alarm begins or ends; return how many.

    Args:
        number: Of the first step.
        levels: The same sensors are known in all of them.
        mask: What is judged by.
        bounds: What is told.
        evidence: Updated, as is all that follows.
        moments: What is learned, after each step was judged.
        peaks: How far the evidence went.

    Cost:
        O(D²) time a step.
    """
    features = np.empty(mask.mean.shape[0])
    left_out = np.zeros(levels.on.shape[1], np.bool_)
    for signal in range(mask.sizes.shape[0]):
        low, high = mask.bounds[signal], mask.bounds[signal + 1]
        left_out[low:high] = not bounds.learned[signal]
    for t in range(levels.on.shape[0]):
        features_of(levels.on[t], levels.known[t], evidence.lately, features)
        judge(features, mask, bounds.learned, evidence)
        note_peaks(evidence.mean, ~bounds.bad, peaks)
        learn_step(features, left_out, moments)
        for w in range(WINDOWS.shape[0]):
            evidence.known[w] += (levels.known[t] - evidence.known[w]) / WINDOWS[w]
        if is_news(number + t, evidence, bounds):
            return t + 1
    return len(levels.on)
