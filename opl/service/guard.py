"""Who may ask the service for what: token, host, origin, and the size of what is sent.

A service without a token listens on this machine only. Pages of strangers in a browser on this
machine could still talk to it, so requests that come from another origin, or to another host name,
are refused.
"""

from __future__ import annotations

import hmac
import json
from collections import Counter
from collections.abc import Sequence
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

OPEN = ("/health",)  # to whoever watches the service
LOCAL = frozenset({"localhost", "127.0.0.1", "::1"})


class _TooLarge(Exception):
    """More was sent than is taken."""


class Guard:
    """Lets through what may be asked, and counts all requests.

    Args:
        app: What is guarded.
        token: Secret that each request has to carry, None for none.
        most_bytes: Of one request.
    """

    def __init__(self, app: ASGIApp, token: str | None, most_bytes: int) -> None:
        self._app = app
        self._token = token
        self._most = most_bytes
        self.answers: Counter[tuple[str, int]] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request (ASGI)."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun, taken = False, 0

        async def counted(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                begun = True
                self.answers[scope["method"], message["status"]] += 1
            await send(message)

        async def limited() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > self._most:
                raise _TooLarge
            return message

        headers = {
            name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]
        }
        refusal = self._refusal(scope["path"], headers)
        if refusal is None:
            try:
                await self._app(scope, limited, counted)
                return
            except _TooLarge:
                if begun:
                    raise
                refusal = self._too_large()
        await _refuse(counted, *refusal)

    def _refusal(self, path: str, headers: dict[str, str]) -> tuple[int, str, str] | None:
        if self._token is not None:
            given = headers.get("authorization", "").removeprefix("Bearer ")
            if path not in OPEN and not hmac.compare_digest(given.encode(), self._token.encode()):
                return 401, "Authorization", "must be: Bearer and the token of the service"
        else:
            host = _host(f"//{headers.get('host', '')}")
            origin = headers.get("origin")
            if host not in LOCAL or (origin is not None and _host(origin) not in LOCAL):
                return 403, "Host or Origin", "a service without a token answers this machine only"
        length = headers.get("content-length", "0")
        if length.isdecimal() and int(length[:18]) > self._most:
            return self._too_large()
        return None

    def _too_large(self) -> tuple[int, str, str]:
        return 413, "body", f"is larger than the {self._most / 1e6:g} MB that are taken"


def _host(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:
        return None


async def _refuse(send: Send, status: int, where: str, message: str) -> None:
    body = json.dumps({"where": where, "message": message}).encode()
    headers: Sequence[tuple[bytes, bytes]] = [
        (b"content-type", b"application/json"),
        (b"content-length", str(len(body)).encode()),
        (b"connection", b"close"),  # the rest of what is sent is not read
    ]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
