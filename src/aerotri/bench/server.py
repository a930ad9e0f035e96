"""The pages of the bench: bound to this machine, behind a random token in the address."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from aerotri.bench.session import Bench
from aerotri.conventions import InputError

STATIC = Path(__file__).parent / "static"
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
HOSTS = ("127.0.0.1", "localhost")
"""Names under which this machine is asked; others come from elsewhere, by a name that leads here."""
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' blob: data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
"""The page may load nothing from elsewhere, and nobody may frame it."""


def make_application(bench: Bench, token: str) -> ASGIApp:
    """The pages of a bench.

    Parameters
    ----------
    token : first part of every path; whoever does not know it is refused with 403.
    """
    routes = [
        Route("/", _page("index.html")),
        *(Route(f"/{file.name}", _page(file.name)) for file in sorted(STATIC.iterdir()) if file.suffix in KINDS),
        Route("/data/summary", _told(lambda asked: bench.summary())),
        Route("/data/state", _told(lambda asked: bench.state())),
        Route("/data/plan", _told(lambda asked: bench.plan())),
        Route("/data/rays", _told(lambda asked: bench.rays(
            max(_whole(asked, "first") or 0, 0), _whole(asked, "image"), _whole(asked, "point"),
            asked.query_params.get("text", "")[:200]))),
        Route("/data/point/{row:int}", _told(lambda asked: bench.point(asked.path_params["row"]))),
        Route("/data/photograph/{row:int}", _told(lambda asked: bench.photograph(asked.path_params["row"]))),
    ]  # fmt: skip
    return _Guard(Starlette(routes=routes), token)


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(24)


class _Guard:
    """Lets through who knows the token and asks this machine by its own name."""

    def __init__(self, inner: ASGIApp, token: str):
        self._inner, self._token = inner, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._inner(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        _, given, rest = (*scope["path"].split("/", 2), "", "")[:3]
        host = Request(scope).headers.get("host", "").rsplit(":", 1)[0]
        known = secrets.compare_digest(given.encode(), self._token.encode())
        if not known or host not in HOSTS:
            await PlainTextResponse("The address is not that of the bench.", 403, HEADERS)(scope, receive, send)
            return
        await self._inner({**scope, "path": f"/{rest}", "raw_path": f"/{rest}".encode()}, receive, send)


def _page(name: str) -> Callable[[Request], Response]:
    """A file of the page."""

    def answer(asked: Request) -> Response:
        file = STATIC / name
        return Response(file.read_bytes(), media_type=KINDS[file.suffix], headers=HEADERS)

    return answer


def _told(work: Callable[[Request], Any]) -> Callable[[Request], Any]:
    """What a piece of work gives as JSON; bad input in words, with 400."""

    async def answer(asked: Request) -> Response:
        try:
            content = await run_in_threadpool(work, asked)
        except InputError as error:
            return JSONResponse({"error": str(error)}, 400, HEADERS)
        return Response(_packed(content), media_type="application/json", headers=HEADERS)

    return answer


def _packed(content: Any) -> bytes:
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode("utf-8")


def _whole(asked: Request, name: str) -> int | None:
    """A whole number of the question; None where it is not asked."""
    text = asked.query_params.get(name, "")
    if not text:
        return None
    if not text.isdecimal() or len(text) > 9:
        raise InputError(f"{name} = '{text[:30]}' is no number of a row", "load the page again")
    return int(text)
