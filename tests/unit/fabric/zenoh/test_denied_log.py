"""Refusals are found in the hub's log, and told in bounded number."""

import os

import pytest

from neurosnap.fabric.zenoh import denied_log
from neurosnap.fabric.zenoh.denied_log import DeniedConnections

ACCESS = "zenoh::net::routing::interceptor::access_control"
NO_CERTIFICATE = (
    "\x1b[2m2026-11-21T06:20:18.515534Z\x1b[0m \x1b[33m WARN\x1b[0m acc-0 ThreadId(06) "
    "\x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:\x1b[0m peer sent no certificates. "
    "Hint: increase the system open file limit."
)


class Told:
    """Refusals with a clock that is set by hand."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.now = 100.0
        self.refusals = DeniedConnections(self.lines.append, lambda: self.now)

    def decided(self, text: str, thread: int = 8) -> None:
        line = f"2026-11-21T06:20:18.5Z TRACE rx-0 ThreadId(0{thread}) {ACCESS}: {text}"
        assert self.refusals.read(line)


def decision(session: str, role: str, what: str, key: str, *, may: bool = False) -> str:
    subject = f"Interface(lo)+CertCommonName({role})+Transport(Tls)+{session}"
    word = "authorized" if may else "unauthorized"
    return f"{session} on {subject} is {word} to {what} on {key}"


@pytest.fixture
def told() -> Told:
    return Told()


def test_a_refused_session_is_told_with_its_reason_and_without_the_hint(
    told: Told,
) -> None:
    assert told.refusals.read(NO_CERTIFICATE)
    assert told.lines == ["session refused: peer sent no certificates."]


@pytest.mark.parametrize("line", ["ready", "", '{"log":null}', "ThreadId(06) a: b"])
def test_what_is_not_from_the_log_is_left_alone(told: Told, line: str) -> None:
    assert not told.refusals.read(line)
    assert told.lines == []


def test_another_warning_is_no_refusal(told: Told) -> None:
    line = "2026-11-21T06:20:18.5Z  WARN rx-0 ThreadId(06) zenoh::api::session: slow"
    assert told.refusals.read(line)
    assert told.lines == []


def test_a_refused_message_is_told_with_role_and_key(told: Told) -> None:
    told.decided(decision("ab1", "cell", "Put (ingress)", "neurosnap/s/wiring/1"))
    assert told.lines == ["cell refused: Put on neurosnap/s/wiring/1"]


def test_neither_what_is_allowed_nor_what_goes_out_is_told(told: Told) -> None:
    told.decided(decision("ab1", "cell", "Put (ingress)", "k", may=True))
    told.decided(decision("ab1", "cell", "Put (egress)", "k"))
    assert told.lines == []


def test_a_decision_in_advance_is_no_attempt_and_its_use_is_one(told: Told) -> None:
    told.decided("ACL (ingress): caching permissions for `n/s/wiring/1` ...")
    for what in ("Query", "Put", "Delete"):
        told.decided(decision("ab1", "cell", f"{what} (ingress)", "n/s/wiring/1"))
    told.decided("ACL (egress): caching permissions for `n/s/wiring/1` ...")
    told.decided(decision("ab1", "cell", "Put (egress)", "n/s/wiring/1"))
    assert told.lines == []
    cached = "Using cached result: ab1 is unauthorized to Put (ingress) on n/s/wiring/1"
    told.decided(cached)
    assert told.lines == ["cell refused: Put on n/s/wiring/1"]


def test_an_attempt_among_decisions_in_advance_is_told(told: Told) -> None:
    told.decided("ACL (ingress): caching permissions for `n/s/wiring/1` ...")
    told.decided(decision("ab1", "cell", "Put (ingress)", "n/s/wiring/1"))
    # Another session's, and on another thread.
    told.decided(decision("cd2", "world", "Put (ingress)", "n/s/wiring/1"))
    told.decided(decision("ef3", "cell", "Put (ingress)", "n/s/wiring/1"), thread=9)
    told.decided("ACL (egress): caching permissions for `n/s/decision` ...")
    told.decided(decision("ab1", "cell", "Put (ingress)", "n/s/decision"))
    assert told.lines == [
        "world refused: Put on n/s/wiring/1",
        "cell refused: Put on n/s/wiring/1",
        "cell refused: Put on n/s/decision",
    ]


def test_the_same_is_told_once_a_window_and_counted(told: Told) -> None:
    for _ in range(5):
        told.refusals.read(NO_CERTIFICATE)
    assert len(told.lines) == 1
    told.now += 10.0
    told.refusals.read(NO_CERTIFICATE)
    told.refusals.close()
    reason = "session refused: peer sent no certificates."
    assert told.lines == [reason, "session refused: and 4 more like these", reason]


def test_a_flood_of_different_ones_is_bounded(told: Told) -> None:
    for number in range(1000):
        name = "".join(chr(97 + int(digit)) for digit in str(number))
        told.decided(decision("ab1", "cell", "Put (ingress)", f"n/s/{name}"))
    told.refusals.close()
    assert len(told.lines) == 11
    assert told.lines[-1] == "cell refused: Put and 990 more like these"


def test_a_flood_hides_neither_its_own_puts_nor_those_of_others(told: Told) -> None:
    for number in range(1000):
        name = "".join(chr(97 + int(digit)) for digit in str(number))
        what = "Declare Subscriber (ingress)"
        told.decided(decision("ab1", "cell/3", what, f"n/s/{name}"))
        told.refusals.read(NO_CERTIFICATE.replace("peer", name))
    told.decided(decision("ab1", "cell/3", "Put (ingress)", "n/s/wiring/1"))
    told.decided(decision("cd2", "world", "Put (ingress)", "n/s/decision"))
    assert told.lines[-2:] == [
        "cell/3 refused: Put on n/s/wiring/1",
        "world refused: Put on n/s/decision",
    ]
    assert len(told.lines) == 22


def test_many_intruders_at_once_are_bounded(told: Told) -> None:
    for intruder in range(1000):
        told.decided(
            decision(f"{intruder:x}", f"cell/{intruder}", "Put (ingress)", "k")
        )
    assert len(told.lines) == 300


def test_what_an_intruder_sends_cannot_act_on_a_terminal(told: Told) -> None:
    told.decided(decision("ab1", "cell", "Put (ingress)", "n/s/\x07\x9b2J" + "x" * 999))
    (line,) = told.lines
    assert line.isprintable()
    assert len(line) < 400


def test_of_sessions_without_end_the_latest_are_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(denied_log, "_SESSIONS", 3)
    told = Told()
    for session in ("a0", "b0", "c0", "a0", "d0"):
        told.decided(decision(session, "cell", "Put (ingress)", "k", may=True))
    for session in ("a0", "b0"):
        cached = f"Using cached result: {session} is unauthorized to Put (ingress) on k"
        told.decided(cached)
    assert told.lines == ["cell refused: Put on k", "stranger refused: Put on k"]


def test_decisions_in_advance_are_told_apart_on_so_many_threads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(denied_log, "_THREADS", 2)
    told = Told()
    for thread in (1, 2, 3):
        told.decided("ACL (ingress): caching permissions for `k` ...", thread)
    for thread in (3, 2, 1):
        told.decided(decision("ab1", f"cell{thread}", "Put (ingress)", "k"), thread)
    assert told.lines == ["cell1 refused: Put on k"]


def test_when_nobody_reads_the_output_refusals_are_told_all_the_same(
    told: Told,
) -> None:
    read, log = os.pipe()
    nobody, own = os.pipe()
    os.close(nobody)
    os.write(log, f"mine\n{NO_CERTIFICATE}\nthe rest".encode())
    os.close(log)
    try:
        denied_log._read(read, own, told.refusals)
    finally:
        os.close(read)
        os.close(own)
    assert told.lines == ["session refused: peer sent no certificates."]
