"""Who is let through to the recording, and where the page is."""

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Scope

from neurosnap.apps.viewer.auth import (
    LARGEST_HEAD,
    LONGEST_ADDRESS,
    Address,
    Guard,
    keep_address,
    kept_address,
)

PORT = 4711
TOKEN = "a-token-of-this-test"
COOKIE = (b"cookie", f"neurosnap-{PORT}={TOKEN}".encode())
HOST = (b"host", f"127.0.0.1:{PORT}".encode())

Headers = Sequence[tuple[bytes, bytes]]


class Answer(NamedTuple):
    status: int
    headers: dict[str, str]
    body: bytes


def ask(
    path: str = "/api/run",
    *,
    query: str = "",
    method: str = "GET",
    headers: Headers = (HOST, COOKIE),
    app: ASGIApp | None = None,
) -> Answer:
    """Make one request of what is guarded."""
    scope: Scope = {
        "type": "http",
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "query_string": query.encode(),
        "headers": list(headers),
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", PORT),
    }
    said: list[Message] = []

    async def receive() -> Message:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Message) -> None:
        said.append(message)

    guarded = app or PlainTextResponse("the recording")
    asyncio.run(Guard(guarded, PORT, TOKEN)(scope, receive, send))
    raw = said[0]["headers"]
    return Answer(
        said[0]["status"],
        {name.decode(): value.decode() for name, value in raw},
        b"".join(message.get("body", b"") for message in said[1:]),
    )


def test_whoever_has_the_cookie_is_let_through() -> None:
    assert ask().body == b"the recording"


@pytest.mark.parametrize(
    "other", ['a={"x": 1}', "path=/x", "bare", "a=b,c", 'q="unended']
)
@pytest.mark.parametrize("order", [1, -1])
def test_cookies_of_other_programs_of_this_machine_do_no_harm(
    other: str, order: int
) -> None:
    brought = "; ".join([other, COOKIE[1].decode()][::order])
    assert ask(headers=[HOST, (b"cookie", brought.encode())]).status == 200


def test_whoever_has_the_address_gets_the_cookie_and_a_clean_address() -> None:
    greeted = ask("/", query=f"token={TOKEN}", headers=[HOST])
    assert (greeted.status, greeted.headers["location"]) == (303, "/")
    cookie, *marks = greeted.headers["set-cookie"].split("; ")
    assert cookie == f"neurosnap-{PORT}={TOKEN}"
    assert {"httponly", "samesite=strict"} <= {mark.lower() for mark in marks}
    assert ask("/", headers=[HOST, (b"cookie", cookie.encode())]).status == 200
    assert ask("/api/run", query=f"token={TOKEN}", headers=[HOST]).status == 200


@pytest.mark.parametrize(
    ("query", "cookie"),
    [
        ("", b""),
        ("token=", b""),
        ("token=other", b""),
        (f"token={TOKEN}x", b""),
        (f"token=x&token={TOKEN}", b""),
        ("token=%ff%00", b""),
        ("", b"neurosnap-4711="),
        ("", b"neurosnap-4711=other"),
        ("", f"neurosnap-4712={TOKEN}".encode()),
        ("", b"\xff\xfe;;=,\x00"),
    ],
)
def test_without_the_token_nothing_is_shown(query: str, cookie: bytes) -> None:
    for path in ("/", "/api/run", "/main.js"):
        refused = ask(path, query=query, headers=[HOST, (b"cookie", cookie)])
        assert refused.status == 401
        assert TOKEN.encode() not in refused.body
        assert b"the recording" not in refused.body


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "[::1]", "LocalHost"])
def test_it_answers_to_its_own_names(name: str) -> None:
    host = f"{name}:{PORT}".encode()
    assert ask(headers=[(b"host", host), COOKIE]).status == 200
    own = (b"origin", b"http://" + host)
    assert ask(headers=[(b"host", host), own, COOKIE]).status == 200


@pytest.mark.parametrize(
    "hosts",
    [
        [],
        [b""],
        [b"127.0.0.1"],
        [b"127.0.0.1:80"],
        [b"evil.example:4711"],
        [b"127.0.0.1:4711.evil.example"],
        [b"localhost.evil.example:4711"],
        [b"0.0.0.0:4711"],
        [b"127.0.0.1:4711", b"127.0.0.1:4711"],
        [b"127.0.0.1:4711", b"evil.example"],
        [b"\xff"],
    ],
)
def test_a_name_that_was_made_to_lead_here_is_refused(hosts: list[bytes]) -> None:
    refused = ask(headers=[*((b"host", host) for host in hosts), COOKIE])
    assert refused.status == 421


@pytest.mark.parametrize(
    "origin",
    [
        b"null",
        b"",
        b"https://127.0.0.1:4711",
        b"http://localhost:4711",
        b"http://127.0.0.1:4712",
        b"http://127.0.0.1:4711.evil.example",
        b"http://evil.example",
    ],
)
def test_a_page_of_somebody_else_is_refused(origin: bytes) -> None:
    assert ask(headers=[HOST, COOKIE, (b"origin", origin)]).status == 403
    own = (b"origin", b"http://" + HOST[1])
    assert ask(headers=[HOST, COOKIE, own, (b"origin", origin)]).status == 403


@pytest.mark.parametrize("site", [b"cross-site", b"same-site", b"?"])
def test_what_a_browser_sends_for_another_page_is_refused(site: bytes) -> None:
    assert ask(headers=[HOST, COOKIE, (b"sec-fetch-site", site)]).status == 403


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "x"])
def test_nothing_can_be_changed(method: str) -> None:
    refused = ask(method=method)
    assert (refused.status, refused.headers["allow"]) == (405, "GET, HEAD")


@pytest.mark.parametrize(
    "header", [(b"content-length", b"5"), (b"transfer-encoding", b"chunked")]
)
def test_a_request_has_no_body(header: tuple[bytes, bytes]) -> None:
    assert ask(headers=[HOST, COOKIE, header]).status == 413


def test_addresses_and_headers_have_bounds() -> None:
    assert ask("/" + "a" * (LONGEST_ADDRESS - 1)).status == 200
    assert ask("/" + "a" * LONGEST_ADDRESS).status == 414
    assert ask("/", query="a" * LONGEST_ADDRESS).status == 414
    fits = LARGEST_HEAD - sum(map(len, HOST + COOKIE)) - 1
    assert ask(headers=[HOST, COOKIE, (b"x", b"a" * fits)]).status == 200
    assert ask(headers=[HOST, COOKIE, (b"x", b"a" * (fits + 1))]).status == 431


@pytest.mark.parametrize("headers", [(HOST, COOKIE), (HOST,), ()])
def test_every_answer_forbids_what_it_does_not_need(headers: Headers) -> None:
    said = ask(headers=headers).headers
    policy = said["content-security-policy"]
    assert policy.startswith("default-src 'self';")
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert said["x-content-type-options"] == "nosniff"
    assert said["referrer-policy"] == "no-referrer"
    assert said["cache-control"] == "no-store"


def test_only_requests_are_taken() -> None:
    async def connect() -> None:
        guard = Guard(PlainTextResponse(""), PORT, TOKEN)
        await guard({"type": "websocket"}, None, None)  # type: ignore[arg-type]

    with pytest.raises(ValueError, match=r"^scope: must be http, got 'websocket'"):
        asyncio.run(connect())


# Where the page is --------------------------------------------------------------------

ADDRESS = Address(8123, "t" * 32)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "neurosnap"


def test_an_address_is_kept_where_nobody_else_may_look(folder: Path) -> None:
    assert kept_address() is None
    keep_address(ADDRESS)
    assert kept_address() == ADDRESS
    assert folder.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize(
    "text", ["", "{}", '{"port": 0, "token": "x"}', '{"port": 70000, "token": "%s"}']
)
def test_what_is_no_address_is_not_used(folder: Path, text: str) -> None:
    keep_address(ADDRESS)
    (folder / "page.json").write_text(text.replace("%s", "t" * 32), encoding="utf-8")
    assert kept_address() is None


def test_a_folder_that_others_may_enter_keeps_nothing(folder: Path) -> None:
    folder.mkdir(mode=0o755)
    folder.chmod(0o755)
    keep_address(ADDRESS)
    assert list(folder.iterdir()) == []
    assert kept_address() is None
