"""A table of readings as bits: one column per sensor, one bit per tick.

Two bits are kept of a reading, for it may be on, off or unknown: 2,000 sensors and
100,000 ticks take 50 MB.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.literal_sets import Words, from_words, to_words
from neurosnap.sensorium import WORDS, Sensorium

_CHUNK = 4096
"""Rows that are packed at a time; a multiple of 64."""


@dataclass(frozen=True, eq=False)
class Columns:
    """The reading of every sensor at every tick.

    Tick ``t``, counted from 0, is bit ``t % 64`` of word ``t // 64``; bits beyond the
    last tick are 0.

    Attributes:
        sensorium: The names of the sensors.
        ticks: ``T``.
        on: ``(N, W)``: the ticks at which each sensor read on.
        off: ``(N, W)``: at which it read off. An unknown reading is in neither.
    """

    sensorium: Sensorium
    ticks: int
    on: Words
    off: Words

    @classmethod
    def of(cls, data: Any, names: Iterable[str] | None = None) -> "Columns":  # noqa: ANN401
        """Return the columns of a table in memory.

        Args:
            data: ``(T, N)``: an array of bool or numbers, 0, 1 or NaN for unknown; or a
                data frame (pandas, polars), whose missing values are unknown, which may
                hold words such as on and off, and whose columns of dates are left out.
            names: Of the sensors; if None, those of the data frame's columns, or
                ``s0``, ``s1`` and so on.

        Raises:
            ShapeError: It has not two axes, or there is not one name a column.
            InvalidValueError: An entry is not 0, 1 or unknown; or a name cannot name a
                sensor.

        Examples:
            >>> columns = Columns.of([[0, 1], [1, float("nan")]], ["door", "motion"])
            >>> columns.reading(1).tolist(), columns.known(1).tolist()
            ([True, False], [True, False])
        """
        if hasattr(data, "columns") and not isinstance(data, np.ndarray):
            series = [(str(title), data[title]) for title in data.columns]
            series = [each for each in series if not _is_dates(each[1])]
            titles = [title for title, _ in series]
            read = [_series(column, title) for title, column in series]
            ticks = len(read[0][0]) if read else 0
            on = np.array([bits for bits, _ in read]).reshape(len(read), ticks)
            known = np.array([sure for _, sure in read]).reshape(len(read), ticks)
            sensorium = Sensorium(titles if names is None else names)
            if len(sensorium) != len(read):
                rule = f"must be {len(read)}, one a column"
                raise ShapeError("names", rule, len(sensorium))
            return cls(sensorium, ticks, to_words(on), to_words(known & ~on))
        array = np.asarray(data)
        if array.ndim != 2:
            raise ShapeError("data", "must be (ticks, sensors)", array.shape)
        sensorium = Sensorium.of(array.shape[1]) if names is None else Sensorium(names)
        growing = GrowingColumns(sensorium)
        for start in range(0, len(array), _CHUNK):
            bits, known = _readings(array[start : start + _CHUNK], start)
            growing.extend(bits, known)
        return growing.columns()

    def until(self, words: int) -> "Columns":
        """Return the first columns, of so many words of 64 ticks, as a copy."""
        on, off = self.on[:, :words].copy(), self.off[:, :words].copy()
        return Columns(self.sensorium, min(self.ticks, 64 * words), on, off)

    def ticks_of(self, literal: int) -> Words:
        """Return ``(W,)``, the ticks at which a literal was read; a view."""
        ticks: Words = (self.off if literal & 1 else self.on)[literal >> 1]
        return ticks

    def reading(self, sensor: int) -> NDArray[np.bool_]:
        """Return ``(T,)``, where a sensor read on."""
        return from_words(self.on[sensor], self.ticks)

    def known(self, sensor: int) -> NDArray[np.bool_]:
        """Return ``(T,)``, where its reading was known."""
        return from_words(self.on[sensor] | self.off[sensor], self.ticks)

    def row(self, tick: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return what all sensors read at a tick from 0 on, and whether it is known.

        Returns:
            ``(N,)`` each.
        """
        word, place = tick // 64, np.uint64(tick % 64)
        bits = (self.on[:, word] >> place & np.uint64(1)).astype(np.bool_)
        off = (self.off[:, word] >> place & np.uint64(1)).astype(np.bool_)
        return bits, bits | off


def span(ticks: Words) -> tuple[int, int]:
    """Return the first and the last of some ticks, ``(W,)``, from 1.

    Returns:
        ``(0, 0)`` if there are none.
    """
    words = ticks.nonzero()[0]
    if not words.size:
        return 0, 0
    low, high = int(words[0]), int(words[-1])
    lowest, highest = int(ticks[low]), int(ticks[high])
    first = 64 * low + (lowest & -lowest).bit_length()
    return first, 64 * high + highest.bit_length()


class GrowingColumns:
    """Columns that are filled from the top, some rows at a time."""

    def __init__(self, sensorium: Sensorium) -> None:
        self._sensorium = sensorium
        self._packed: list[tuple[Words, Words]] = []
        self._rows: list[tuple[NDArray[np.bool_], NDArray[np.bool_] | None]] = []
        self._waiting = 0
        self.ticks = 0

    def append(
        self, bits: NDArray[np.bool_], known: NDArray[np.bool_] | None = None
    ) -> None:
        """Add a row, ``(N,)`` each; it is kept, not copied."""
        self.extend(bits[np.newaxis], None if known is None else known[np.newaxis])

    def extend(
        self, bits: NDArray[np.bool_], known: NDArray[np.bool_] | None = None
    ) -> None:
        """Add rows.

        Args:
            bits: ``(n, N)``; it is kept, not copied.
            known: ``(n, N)``; if None, all.

        Raises:
            ShapeError: They are of another number of sensors.
        """
        if bits.shape[1:] != (len(self._sensorium),):
            rule = f"must be of {len(self._sensorium)} sensors"
            raise ShapeError("rows", rule, bits.shape)
        self._rows.append((bits, known))
        self._waiting += len(bits)
        self.ticks += len(bits)
        if self._waiting >= _CHUNK:
            self._pack(self._waiting // _CHUNK * _CHUNK)

    def columns(self) -> Columns:
        """Return the columns of all rows so far."""
        if self._waiting:
            self._pack(self._waiting)
        none = np.zeros((len(self._sensorium), 0), np.uint64)
        on = np.concatenate([none, *(on for on, _ in self._packed)], axis=1)
        off = np.concatenate([none, *(off for _, off in self._packed)], axis=1)
        return Columns(self._sensorium, self.ticks, on, off)

    def _pack(self, rows: int) -> None:
        """Pack that many of the rows that wait: all, or whole chunks."""
        bits = np.concatenate([bits for bits, _ in self._rows])
        known = np.concatenate(
            [
                np.ones_like(bits) if known is None else known
                for bits, known in self._rows
            ]
        )
        ready, sure = bits[:rows].T, known[:rows].T
        self._packed.append((to_words(ready & sure), to_words(~ready & sure)))
        self._rows = [(bits[rows:], known[rows:])] if rows < len(bits) else []
        self._waiting -= rows


def _is_dates(column: Any) -> bool:  # noqa: ANN401
    """Return whether a column of a data frame holds moments, and no readings."""
    values = np.asarray(column.to_numpy())
    if values.dtype.kind == "O":  # with a time zone
        return any(isinstance(value, date) for value in values)
    return bool(values.dtype.kind == "M")


def _series(column: Any, name: str) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:  # noqa: ANN401
    """Return what a column of a data frame says, and where it is known."""
    missing = column.isna() if hasattr(column, "isna") else column.is_null()
    known = ~np.asarray(missing.to_numpy(), np.bool_)
    values = np.asarray(column.to_numpy())
    bits = np.zeros(len(known), np.bool_)
    # Only those: what stands for a missing value has no truth of its own.
    there = values[known].tolist()
    if any(isinstance(value, str) for value in there):
        words = [str(value).strip().casefold() for value in there]
        there = [WORDS.get(*pair) for pair in zip(words, there, strict=True)]
    told, sure = _readings(np.array(there).reshape(-1, 1), 0, name)
    bits[known] = told[:, 0]
    known[known] = sure[:, 0]
    return bits, known


def _readings(
    rows: NDArray[Any], start: int, name: str = ""
) -> tuple[NDArray[np.bool_], NDArray[np.bool_] | Any]:
    """Return what rows of an array say, and where it is known.

    Args:
        rows: ``(n, m)``.
        start: The number of the first.
        name: Of the only column, if it has one.
    """
    if rows.dtype == np.bool_:
        return rows, np.ones_like(rows)
    if rows.dtype.kind == "O":
        missing = np.frompyfunc(lambda value: value is None, 1, 1)(rows)
        rows = np.where(missing.astype(np.bool_), np.nan, rows)
        try:
            rows = rows.astype(np.float64)
        except (TypeError, ValueError) as error:
            rule = "must be made of 0, 1 and unknown"
            raise InvalidValueError(name or "data", rule, str(error)) from error
    if rows.size and rows.dtype.kind not in "biuf":
        rule = "must be made of 0, 1 and unknown"
        raise InvalidValueError(name or "data", rule, rows.flat[0])
    on = rows == 1
    known = on | (rows == 0)
    wrong = ~known & ~np.isnan(rows) if rows.dtype.kind == "f" else ~known
    if wrong.any():
        row, column = (int(k) for k in np.argwhere(wrong)[0])
        where = f"{name or column}, row {start + row}"
        rule = "must be 0, 1 or unknown"
        raise InvalidValueError(where, rule, rows[row, column].item())
    return on, known
