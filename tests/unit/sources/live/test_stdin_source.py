"""Lines are read from a pipe correctly, even if they arrive in pieces."""

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.sources.live import stdin_source
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import ROOM, LiveSource
from neurosnap.sources.live.stdin_source import (
    Lines,
    StdinFeeder,
    first_lines,
    names_in,
)
from neurosnap.sources.live.tick_schedule import OnChange
from neurosnap.sources.open import open_live, settle
from tests.support.fake_time import Told
from tests.support.sources import readings

NAMES = ["door", "motion"]


class Pipe:
    """Both ends of a pipe."""

    def __init__(self) -> None:
        self.reads, self._writes = os.pipe()
        self._open = True

    def write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._writes, data) :]

    def end(self) -> None:
        if self._open:
            self._open = False
            os.close(self._writes)

    def close(self) -> None:
        self.end()
        os.close(self.reads)


@pytest.fixture
def pipe(monkeypatch: pytest.MonkeyPatch) -> Iterator[Pipe]:
    """A pipe in the place of standard input."""
    made = Pipe()
    monkeypatch.setattr(stdin_source, "STANDARD_INPUT", made.reads)
    yield made
    made.close()


@pytest.fixture
def source(pipe: Pipe) -> Iterator[LiveSource]:
    made = source_on()
    yield made
    made.close()


def source_on(head: bytes | None = None) -> LiveSource:
    return LiveSource(LatestReadings(NAMES), OnChange(), feeder=StdinFeeder(head))


def rest_of(source: LiveSource, *, begun: bool = False) -> list[list[bool | None]]:
    """Return all ticks to the end; None is what is not known."""
    ticks = []
    seen = source.step(-1) if begun else source.first()
    while seen is not None:
        ticks.append(readings(seen))
        seen = source.step(-1)
    return ticks


def test_every_whole_reading_is_a_tick(pipe: Pipe, source: LiveSource) -> None:
    pipe.write(b'{"bits": [1, 0]}\n\n{"bits": [1, 0]}\r\n')
    pipe.write(b'{"bits": {"motion": "ON"}}\n{"bits": [0, 0]}')  # no line feed
    pipe.end()
    assert rest_of(source) == [[True, False], [True, False], [None, True], [False] * 2]
    assert source.statistics().received.refused == 0


def test_bad_lines_are_told_of_with_their_number_and_the_run_goes_on(
    pipe: Pipe, source: LiveSource, caplog: pytest.LogCaptureFixture
) -> None:
    pipe.write(b'{"bits": [1, 0]}\nnonsense\n{"bits": [1]}\n')
    pipe.write(b'{"sensors": ["a"]}\n')
    pipe.write(b'{"bits": {"lamp": 1, "door": 0}}\n')
    pipe.end()
    assert rest_of(source) == [[True, False], [False, None]]
    assert source.statistics().received.refused == 3  # the last names one, too
    first = caplog.records[0].getMessage()
    assert first.startswith("standard input:2: reading: must be a reading in JSON (")


def test_the_pipe_holds_back_who_writes_and_nothing_is_lost(pipe: Pipe) -> None:
    count = 5 * ROOM
    line = b'{"bits": [%d, %d]}\n'

    def write() -> None:
        for number in range(count):
            pipe.write(line % (number % 2, number % 3 == 0))
        pipe.end()

    source = source_on()
    source._condition = lock = Told()
    writing = threading.Thread(target=write)
    writing.start()
    assert source.first() is not None
    lock.waiting.clear()
    assert lock.waiting.wait(20)  # it is full, and the reader waits for room
    ticks = rest_of(source, begun=True)
    writing.join()
    source.close()
    assert ticks == [[number % 2 == 1, number % 3 == 0] for number in range(1, count)]
    assert source.statistics().received.dropped == 0


@pytest.mark.parametrize("begun", [False, True], ids=["begins", "goes on"])
@pytest.mark.parametrize("blank", [0, 2])
def test_the_head_is_the_first_reading_of_a_run_that_begins_and_counts_as_a_line(
    pipe: Pipe, caplog: pytest.LogCaptureFixture, blank: int, begun: bool
) -> None:
    pipe.write(b"\n" * blank + b'{"bits": {"door": 1, "motion": 1}}\n')
    source = source_on(first_lines(60, 4)[0])
    pipe.write(b'{"bits": [0, 0]}\nnonsense\n')
    pipe.end()
    ticks = rest_of(source, begun=begun)
    assert ticks == [[True, True], [False, False]][begun:]
    source.close()
    said = f"standard input:{3 + blank}: reading: must be"
    assert caplog.messages[0].startswith(said)


def test_closing_ends_a_reader_that_waits_for_input(pipe: Pipe) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    source_on().close()  # without a start
    source = source_on()
    pipe.write(b'{"bits": [1, 0]}\n{"bits"')
    assert source.first() is not None
    source.close()  # would never return if it waited for the pipe
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    assert source.step(-1) is None
    assert source.statistics().received.refused == 0


def test_what_cannot_be_read_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = os.open(tmp_path, os.O_RDONLY)
    monkeypatch.setattr(stdin_source, "STANDARD_INPUT", folder)
    source = source_on()
    rule = r"^standard input: must be readable, got Is a directory$"
    with pytest.raises(FabricError, match=rule):
        source.first()
    source.close()
    os.close(folder)


# The first line -----------------------------------------------------------------------


def test_the_first_line_names_the_signals(pipe: Pipe) -> None:
    pipe.write(b'\n  \n{"bits": {"door": 1}}\n{"bits": [1]}\n')
    line, signals = first_lines(60, 4)
    assert signals == {"door": (None,)}
    assert line == b'\n  \n{"bits": {"door": 1}}\n{"bits": [1]}'
    assert names_in(b'{"bits": {"motion": 0, "door": 1}}') == ("motion", "door")
    pipe.write(b"\n \n")
    pipe.end()
    rule = r"^standard input: must begin with a line that names the sensors"
    with pytest.raises(InvalidValueError, match=rule):
        first_lines(60, 4)


def test_numbers_are_cut_by_the_first_lines_which_get_their_ticks(
    pipe: Pipe, caplog: pytest.LogCaptureFixture
) -> None:
    lines = [
        b'{"bits": {"same": 9, "v": %d, "ranges": [%d, 9], "door": 1}}' % (n, n)
        for n in range(4)
    ]
    lines[2:2] = [b"nonsense", b'{"bits": {"v": 1, "door": 0}}']
    pipe.write(b"\n".join(lines) + b'\n{"bits": {"v"')
    pipe.end()
    settled = settle("-", {"bins": 2})
    said, left = caplog.messages
    assert said == "learning the range: from 1,000 lines, or 600 seconds"
    assert left.endswith("(--when reads them): same, ranges[1]")
    source = open_live("-", settled)
    assert source.sensors == ("v>1", "door", "ranges[0]>2")
    again = settle("-", settled)
    assert again == settled
    assert rest_of(source) == [
        *([False, True, False], [False, True, False], [False, False, None]),
        *([True, True, False], [True, True, True]),
    ]
    source.close()
    assert source.statistics().received.refused == 2  # no reading, and half of one


def test_conditions_read_what_is_named_and_the_rest_is_told_of(
    pipe: Pipe, caplog: pytest.LogCaptureFixture
) -> None:
    sensors = '["min(ranges[0:2]) < 5, off > 7", "arm.angle rises", "door"]'
    source = open_live("-", {"sensors": sensors})
    assert source.sensors == ("min(ranges[0:2])<5", "arm.angle rises", "door")
    pipe.write(b"""\
{"bits": {"ranges": [4, 8, 1], "arm": {"angle": 3, "x": 1}}}
{"bits": {"ranges": [6, 8, 1], "arm": {"angle": 4}, "lamp": 1}}
{"bits": {"ranges": [8, 9, 1], "arm": {"angle": "up"}}}
{"bits": {"ranges": [8, 9, 1], "arm": {"angle": 4}, "door": 1}}
""")
    pipe.end()
    assert rest_of(source) == [
        *([True, None, None], [True, True, None], [False, False, True])
    ]
    assert caplog.messages[0].startswith("sensor: must be one the run began with, got")
    assert source.statistics().received.refused == 1  # "up"
    source.close()


@pytest.mark.parametrize(
    ("line", "rule"),
    [
        (b'{"bits": [1, 0]}', "must name all sensors"),
        (b'{"sensor": "door", "on": 1}', "must name all sensors"),
        (b"door,motion", "must be a reading in JSON"),
    ],
)
def test_a_first_line_that_names_no_sensors(line: bytes, rule: str) -> None:
    with pytest.raises(InvalidValueError) as caught:
        names_in(line)
    assert str(caught.value).startswith(f"standard input:1: reading: {rule}")
    with pytest.raises(InvalidValueError, match=r"^standard input:3: reading: must"):
        names_in(b"\n\n" + line)


SHORT = 6


@given(
    st.lists(st.binary(max_size=12) | st.sampled_from([b"\n", b"abcdef"]), max_size=12),
)
def test_pieces_make_the_lines_that_the_whole_has(pieces: list[bytes]) -> None:
    lines = Lines(SHORT)
    found: list[tuple[int, bytes]] = []
    for piece in pieces:
        found += lines.feed(piece)
        assert len(lines._rest) <= SHORT + 1  # a line without an end is not held
    found += lines.finish()
    found = [(number, line[: SHORT + 1]) for number, line in found]
    texts = b"".join(pieces).split(b"\n")
    if texts[-1] == b"":
        texts.pop()
    assert found == [*enumerate((text[: SHORT + 1] for text in texts), 1)]
