"""Where the page is, and what may ask it: a secret address, and this machine only.

Any page that is open in a browser here can send requests to this machine, and by a name
that it lets resolve to it can even read the answers; and any user of the machine can
connect. So a request has to name this server as its host, must not come from another
page, and has to bring the token that only the address printed at the start has.

Nothing is ever changed by a request, so only GET and HEAD are taken.

Port and token are the same at one start and the next, if that can be. Links to the page
then lead to it after another start, too, in a browser that was let in before. The file
with them is in the folder that only this user can enter, which the system empties when
it starts or the user logs out.
"""

import secrets
from contextlib import suppress
from urllib.parse import parse_qs

import msgspec
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from neurosnap.apps.viewer.api import Wrong
from neurosnap.errors import SwarmError
from neurosnap.runtime.registry import own_folder
from neurosnap.system.durable import replace_file

LOOPBACK = "127.0.0.1"

LONGEST_ADDRESS = 2048
"""Bytes of a path with its query."""
LARGEST_HEAD = 16384
"""Bytes of all headers."""
_FILE = "page.json"
_NAMES = ("127.0.0.1", "localhost", "[::1]")
_HEADERS = {
    "content-security-policy": "default-src 'self'; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'; object-src 'none'",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}
_DEFAULTS = {"cache-control": "no-store"}
_FROM_ELSEWHERE = (
    "This link was opened from another page, which must not lead here.",
    "Copy the link, and paste it into the address bar.",
)
_WITHOUT_TOKEN = (
    "This browser has not been let in yet.",
    "Open the address that neurosnap view has printed in the terminal. After that this"
    " link works, too.",
)


class Address(msgspec.Struct, frozen=True):
    """Where a page is, and what lets one in."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """What to open in a browser. Who has it may look at the recording."""
        return f"http://{LOOPBACK}:{self.port}/?token={self.token}"


def kept_address() -> Address | None:
    """Return the address that was kept; None if there is none that can be used."""
    with suppress(OSError, SwarmError, msgspec.MsgspecError):
        kept = msgspec.json.decode((own_folder() / _FILE).read_bytes(), type=Address)
        if 0 < kept.port < 1 << 16 and len(kept.token) >= 32:
            return kept
    return None


def keep_address(address: Address) -> None:
    """Keep an address; where that is not possible, the next start has another."""
    with suppress(OSError, SwarmError):
        replace_file(own_folder() / _FILE, msgspec.json.encode(address))


def refusal(status: int, error: str) -> Response:
    """Return what is wrong, as JSON."""
    body = msgspec.json.encode(Wrong(error))
    return Response(body, status, media_type="application/json")


class Guard:
    """Lets through what is asked rightly; puts on every answer what it may not do.

    Args:
        app: Whom the rest is left to.
        port: Where the server listens.
        token: What a request has to bring: ``?token=…``, which is answered by a cookie,
            or that cookie.
    """

    def __init__(self, app: ASGIApp, port: int, token: str) -> None:
        self._app = app
        self._token = token
        self._cookie = f"neurosnap-{port}"
        self._hosts = {f"{name}:{port}" for name in _NAMES}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Take one request."""
        if scope["type"] != "http":
            raise ValueError(f"scope: must be http, got {scope['type']!r}")

        async def send_on(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(_HEADERS)
                for name, value in _DEFAULTS.items():
                    headers.setdefault(name, value)
            await send(message)

        app = self._refused(scope) or self._greeted(scope) or self._app
        await app(scope, receive, send_on)

    def _refused(self, scope: Scope) -> Response | None:
        """Return the answer to a request that is not let through."""
        if len(scope["raw_path"]) + len(scope["query_string"]) > LONGEST_ADDRESS:
            return refusal(414, f"address: must have at most {LONGEST_ADDRESS} bytes")
        if sum(len(k) + len(v) for k, v in scope["headers"]) > LARGEST_HEAD:
            return refusal(431, f"headers: must have at most {LARGEST_HEAD} bytes")
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0].lower() not in self._hosts:
            return refusal(421, "host: must be this server by its own name and port")
        origins = headers.getlist("origin")
        if any(origin.lower() != f"http://{hosts[0].lower()}" for origin in origins):
            return refusal(403, "origin: must be this server's own page")
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            error = "request: must come from this server's own page"
            return _answer(headers, 403, error, _FROM_ELSEWHERE)
        if scope["method"] not in ("GET", "HEAD"):
            response = refusal(405, "method: must be GET or HEAD")
            response.headers["allow"] = "GET, HEAD"
            return response
        if headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
            return refusal(413, "request: must have no body")
        return None

    def _greeted(self, scope: Scope) -> Response | None:
        """Return the answer to a request with the token, or without any.

        The token leaves the address bar at once: it would stay in the history.
        """
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])
        if self._is_token(given[0]):
            if scope["path"] != "/":
                return None
            response = RedirectResponse("/", 303)
            response.set_cookie(
                self._cookie, self._token, httponly=True, samesite="strict"
            )
            return response
        if self._is_token(self._brought(scope)):
            return None
        error = "token: must be the one in the address that was printed"
        return _answer(Headers(scope=scope), 401, error, _WITHOUT_TOKEN)

    def _brought(self, scope: Scope) -> str:
        """Return the token in the cookie; empty: there is none."""
        # Not by http.cookies, which drops all of them for one that it cannot read: a
        # browser sends what other programs of this machine have set, too.
        return HTTPConnection(scope).cookies.get(self._cookie, "")

    def _is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self._token.encode())


def _answer(
    headers: Headers, status: int, error: str, lines: tuple[str, str]
) -> Response:
    """Return what is wrong: to a person in a page, to a program as everywhere."""
    if headers.get("sec-fetch-dest") != "document":
        return refusal(status, error)
    said = "".join(f"<p>{line}</p>" for line in lines)
    head = "<meta charset=utf-8><meta name=viewport content='width=device-width'>"
    page = (
        f"<!doctype html><html lang=en>{head}<title>neurosnap</title><h1>neurosnap</h1>"
    )
    return HTMLResponse(f"{page}{said}", status)
