"""Access control of the page, and its address."""

import asyncio
from collections.abc import Sequence
from typing import Any, NamedTuple

import pytest
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Scope

from neurosnap.apps.viewer.auth import Address, Guard

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
    asyncio.run(Guard(guarded, Address(PORT, TOKEN), {})(scope, receive, send))
    raw = said[0]["headers"]
    return Answer(
        said[0]["status"],
        {name.decode(): value.decode() for name, value in raw},
        b"".join(message.get("body", b"") for message in said[1:]),
    )


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
    shown = ask("/", headers=[HOST, (b"cookie", cookie.encode())])
    assert (shown.status, shown.body) == (200, b"the recording")
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


OWN = (b"origin", b"http://" + HOST[1])
ELSEWHERE = b"evil.example:4711"
STATUS: dict[str, list[tuple[int, dict[str, Any]]]] = {
    "its own names": [
        (200, {"headers": [(b"host", host), *own, COOKIE]})
        for name in (b"127.0.0.1", b"localhost", b"[::1]", b"LocalHost")
        for host in [name + b":4711"]
        for own in ([], [(b"origin", b"http://" + host)])
    ],
    "a name that was made to lead here": [
        (421, {"headers": [*((b"host", host) for host in hosts), COOKIE]})
        for hosts in (
            [], [b""], [b"127.0.0.1"], [b"127.0.0.1:80"], [ELSEWHERE], [b"0.0.0.0:4711"],
            [b"127.0.0.1:4711.evil.example"], [b"localhost." + ELSEWHERE], [b"\xff"],
            [HOST[1], HOST[1]], [HOST[1], ELSEWHERE],
        )
    ],
    "a page from elsewhere": [
        (403, {"headers": [HOST, COOKIE, *own, (b"origin", origin)]})
        for own in ([], [OWN])
        for origin in (
            b"null", b"", b"https://127.0.0.1:4711", b"http://localhost:4711",
            b"http://127.0.0.1:4712", b"http://127.0.0.1:" + ELSEWHERE,
            b"http://evil.example",
        )
    ],
    "what a browser sends for another page": [
        (403, {"headers": [HOST, COOKIE, (b"sec-fetch-site", site)]})
        for site in (b"cross-site", b"same-site", b"?")
    ],
    "another method": [
        (405, {"method": method})
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "x")
    ],
}  # fmt: skip


@pytest.mark.parametrize("what", STATUS)
def test_only_what_is_asked_rightly_is_let_through(what: str) -> None:
    for status, asked in STATUS[what]:
        said = ask(**asked)
        assert said.status == status, asked
        assert said.headers.get("allow") == ("GET, HEAD" if status == 405 else None)


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


async def test_only_requests_are_taken() -> None:
    guard = Guard(PlainTextResponse(""), Address(PORT, TOKEN), {})
    with pytest.raises(ValueError, match=r"^scope: must be http, got 'websocket'"):
        await guard({"type": "websocket"}, None, None)  # type: ignore[arg-type]
