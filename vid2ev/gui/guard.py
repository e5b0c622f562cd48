"""A page on loopback is for this machine alone: what asks for it under another name is another page's doing.

A page of the web can have a browser resolve its own name to 127.0.0.1 and so read what is served there (DNS rebinding);
the name that it asks for gives it away.  What another port of this machine serves is another page, too.
"""

from __future__ import annotations

from ipaddress import ip_address
from typing import Any

from starlette.responses import PlainTextResponse


class Guard:
    """Middleware that answers on loopback by loopback's names only."""

    def __init__(self, app: Any, host: str):
        self._app, self._local = app, is_loopback(host)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if self._local and scope["type"] in ("http", "websocket"):
            headers = dict(scope["headers"])
            asked = headers.get(b"host", b"").decode("latin-1")
            came = headers.get(b"origin", b"").decode("latin-1")
            if not is_loopback(_name(asked)) or came not in ("", f"http://{asked}"):
                if scope["type"] == "websocket":
                    await send({"type": "websocket.close", "code": 1008})
                else:
                    await PlainTextResponse("not for this name; open it as 127.0.0.1", 403)(scope, receive, send)
                return
        await self._app(scope, receive, send)


def is_loopback(host: str) -> bool:
    """Whether a host is this machine alone: localhost, or an address such as 127.0.0.1."""
    try:
        return host.lower() == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def _name(host: str) -> str:
    """A host without its port."""
    return host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
