"""Refused sessions are found in the hub's log, and reported in bounded number."""

import os
from types import SimpleNamespace

import pytest

from neurosnap.fabric.zenoh import denied_log
from neurosnap.fabric.zenoh.denied_log import DeniedSessions

NO_CERTIFICATE = (
    "\x1b[2m2026-11-21T06:20:18.515534Z\x1b[0m \x1b[33m WARN\x1b[0m acc-0 ThreadId(06) "
    "\x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:\x1b[0m peer sent no certificates. "
    "Hint: increase the system open file limit."
)
REFUSED = "session refused: peer sent no certificates."


class Told:
    """Refusals with a clock that is set by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.lines: list[str] = []
        self.now = 100.0
        self.refusals = DeniedSessions(self.lines.append)
        clock = SimpleNamespace(monotonic=lambda: self.now)
        monkeypatch.setattr(denied_log, "time", clock)


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Told:
    return Told(monkeypatch)


@pytest.mark.parametrize(
    ("line", "before", "lines"),
    [
        (NO_CERTIFICATE, "", [REFUSED]),
        (f"read{NO_CERTIFICATE}", "read", [REFUSED]),
        ("2026-11-21T06:20:18.5Z  WARN rx-0 ThreadId(06) zenoh::api: slow", "", []),
        *[(line, None, []) for line in ("ready", '{"log":null}', "ThreadId(06) a: b")],
    ],
)
def test_a_refused_session_alone_is_reported(
    told: Told, line: str, before: str | None, lines: list[str]
) -> None:
    assert told.refusals.read(line) == before
    assert told.lines == lines


def test_the_same_is_reported_once_a_window_and_a_flood_is_counted(told: Told) -> None:
    for number in range(1000):
        name = "".join(chr(97 + int(digit)) for digit in str(number))
        told.refusals.read(NO_CERTIFICATE.replace("peer", name))
    assert len(told.lines) == 10
    told.now += 10.0
    for _ in range(5):
        told.refusals.read(NO_CERTIFICATE)
    told.refusals.close()
    more = [f"session refused: and {count} more like these" for count in (990, 4)]
    assert told.lines[10:] == [more[0], REFUSED, more[1]]


def test_what_an_intruder_sends_cannot_act_on_a_terminal(told: Told) -> None:
    told.refusals.read(NO_CERTIFICATE.replace("peer", "\x07\x9b2J" + "x" * 999))
    (line,) = told.lines
    assert line.isprintable()
    assert len(line) < 400


def test_a_line_that_zenohs_log_cuts_in_two_is_passed_on_whole(told: Told) -> None:
    read, log = os.pipe()
    other, own = os.pipe()
    os.write(log, f"ready{NO_CERTIFICATE}\n\nmore\n".encode())
    os.close(log)
    denied_log._read(read, own, told.refusals)
    os.close(own)
    assert os.read(other, 100) == b"ready\nmore\n"
    for end in (read, other):
        os.close(end)


def test_where_no_process_reads_the_output_refusals_are_reported_all_the_same(
    told: Told,
) -> None:
    read, log = os.pipe()
    unread, own = os.pipe()
    os.close(unread)
    os.write(log, f"mine\n{NO_CERTIFICATE}\nthe rest".encode())
    os.close(log)
    try:
        denied_log._read(read, own, told.refusals)
    finally:
        os.close(read)
        os.close(own)
    assert told.lines == [REFUSED]
