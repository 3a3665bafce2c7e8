"""Access to the page: by a secret address, from this machine only.

Any page that is open in a browser here can send requests to this machine, and by a name
that it lets resolve to it can even read the answers; and any user of the machine can
connect. So a request has to name this server as its host, must not come from another
page, and has to bring the token that only the address printed at the start has.

Nothing is ever changed by a request, so only GET and HEAD are taken.
"""

import asyncio
import secrets
from typing import TypeAlias
from urllib.parse import parse_qs

import msgspec
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from neurosnap.apps.viewer.api import Wrong

LOOPBACK = "127.0.0.1"
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
Strangers: TypeAlias = dict[tuple[str, int] | None, asyncio.Transport]
"""Connections by where they come from, the oldest first."""


class Address(msgspec.Struct, frozen=True):
    """The address of a page, with the secret token that opens it."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """The address to open in a browser; it alone gives access to the recording."""
        return f"http://{LOOPBACK}:{self.port}/?token={self.token}"


def refusal(status: int, error: str) -> Response:
    """Return an error as JSON."""
    body = msgspec.json.encode(Wrong(error))
    return Response(body, status, media_type="application/json")


class Guard:
    """Rejects requests without the token, and adds security headers to every answer.

    Args:
        app: Whom the rest is left to.
        address: Where the server listens, and the token that a request has to bring:
            as ``?token=…``, which is answered by a cookie, or as that cookie.
        strangers: The connections that have not brought it.
    """

    def __init__(self, app: ASGIApp, address: Address, strangers: Strangers) -> None:
        self._app = app
        self._strangers = strangers
        self._token = address.token
        self._cookie = f"neurosnap-{address.port}"
        self._hosts = {f"{name}:{address.port}" for name in _NAMES}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Take one request."""
        if scope["type"] != "http":
            raise ValueError(f"scope: must be http, got {scope['type']!r}")

        async def send_on(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(_HEADERS)
                headers.setdefault("cache-control", "no-store")
            await send(message)

        app = self._refused(scope) or self._greeted(scope) or self._app
        await app(scope, receive, send_on)

    def _refused(self, scope: Scope) -> Response | None:
        """Return the answer to a request that is not let through."""
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0].lower() not in self._hosts:
            return refusal(421, "host: must be this server by its own name and port")
        origins = headers.getlist("origin")
        if any(origin.lower() != f"http://{hosts[0].lower()}" for origin in origins):
            return refusal(403, "origin: must be this server's own page")
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            error = "link: must not be in another page: paste it into the address bar"
            return refusal(403, error)
        if scope["method"] not in ("GET", "HEAD"):
            response = refusal(405, "method: must be GET or HEAD")
            response.headers["allow"] = "GET, HEAD"
            return response
        return None

    def _greeted(self, scope: Scope) -> Response | None:
        """Return the answer to a request with the token, or without any.

        The token leaves the address bar at once: it would stay in the history.
        """
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])
        # Not by http.cookies, which drops all of them for one that it cannot read: a
        # browser sends what other programs of this machine have set, too.
        shown = HTTPConnection(scope).cookies.get(self._cookie, "")
        if self._is_token(given[0]) or self._is_token(shown):
            self._strangers.pop(scope["client"], None)
        if self._is_token(given[0]):
            if scope["path"] != "/":
                return None
            response = RedirectResponse("/", 303)
            response.set_cookie(
                self._cookie, self._token, httponly=True, samesite="strict"
            )
            return response
        if self._is_token(shown):
            return None
        error = (
            "token: must be that of the address neurosnap view printed: open that first"
        )
        return refusal(401, error)

    def _is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self._token.encode())
