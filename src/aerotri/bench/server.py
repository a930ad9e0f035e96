"""The pages of the bench: bound to this machine, behind a random token in the address."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from pathlib import Path
from string import Template
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from aerotri.bench.session import Bench
from aerotri.bench.shown import RELOAD
from aerotri.conventions import InputError

MOST, LONGEST = 10**9, 1000
LONGEST_ADDRESS = 2000
"""Characters; a number of thousands of digits is none of ours, and Python refuses to read it."""
STATIC = Path(__file__).parent / "static"
KINDS = {".js": "text/javascript", ".css": "text/css"}
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
        Route("/", page("index.html", "main.js", "result")),
        *files_of_page(),
        *(Route(f"/data/{path}", told(work)) for path, work in _questions(bench).items()),
        *(Route(f"/act/{path}", done(work), methods=["POST"]) for path, work in _actions(bench).items()),
        Route("/tile/{image:int}/{level:int}/{column:int}/{row:int}", _shown(lambda asked: bench.pictures.tile(
            *(asked.path_params[name] for name in ("image", "level", "column", "row"))))),
        Route("/layer/{number:int}", _shown(lambda asked: bench.layer(asked.path_params["number"]))),
        Route("/cutout/{image:int}", _shown(lambda asked: bench.cutout(
            asked.path_params["image"], *(_whole(asked, name) or 0 for name in ("left", "top", "size"))))),
    ]  # fmt: skip
    return Guard(Starlette(routes=routes), token)


def files_of_page() -> list[Route]:
    """The files that pages load."""
    return [Route(f"/{file.name}", page_file(file.name)) for file in sorted(STATIC.iterdir()) if file.suffix in KINDS]


def _questions(bench: Bench) -> dict[str, Callable[[Request], Any]]:
    """What the page asks for, by path."""
    return {
        "summary": lambda asked: bench.summary(),
        "state": lambda asked: bench.state(),
        "plan": lambda asked: bench.plan(),
        "ellipses": lambda asked: bench.ellipses(),
        "edits": lambda asked: bench.measuring.edits(),
        "next": lambda asked: bench.next(),
        "layers": lambda asked: bench.layers(),
        "targets/{image:int}": lambda asked: bench.measuring.targets(asked.path_params["image"]),
        "difference": lambda asked: bench.difference(),
        "rays": lambda asked: bench.rays(
            max(_whole(asked, "first") or 0, 0), _whole(asked, "image"), _whole(asked, "point"),
            asked.query_params.get("text", "")[:200]),
        "point/{row:int}": lambda asked: bench.point(asked.path_params["row"]),
        "photograph/{row:int}": lambda asked: bench.photograph(asked.path_params["row"]),
        "epipolar/{image:int}/{point:int}": lambda asked: bench.epipolar(
            asked.path_params["image"], asked.path_params["point"]),
    }  # fmt: skip


def _actions(bench: Bench) -> dict[str, Callable[[Given], Any]]:
    """What the page does, by path."""
    return {
        "mark": lambda given: bench.measuring.mark(
            given.row("image"), given.text("point"), given.place(), given.text("reason"), given.is_set("snap")),
        "remove": lambda given: bench.measuring.remove(given.row("image"), given.text("point"), given.text("reason")),
        "switch": lambda given: bench.measuring.switch(
            given.row("image") if given.has("image") else None, given.text("point"), given.text("action"),
            given.text("reason")),
        "mark_targets": lambda given: bench.measuring.mark_targets(given.row("image")),
        "give": lambda given: bench.measuring.give(
            given.text("point"), given.text("action"), given.numbers("given", 6), given.text("reason")),
        "undo": lambda given: bench.measuring.undo(),
        "adjust": lambda given: bench.adjust(),
        "stop": lambda given: bench.stop(),
    }  # fmt: skip


class Given:
    """What the page says with an action, checked piece by piece.

    Parameters
    ----------
    content : as read from JSON.

    Raises
    ------
    InputError
        By every method, when the page says something else.
    """

    def __init__(self, content: Any):
        self._content: dict[str, Any] = content if isinstance(content, dict) else {}

    def has(self, name: str) -> bool:
        """Whether it is said."""
        return self._content.get(name) is not None

    def is_set(self, name: str) -> bool:
        """Whether it is said to be so."""
        return self._content.get(name) is True

    def row(self, name: str) -> int:
        """A row of a table."""
        value = self._content.get(name)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < MOST:
            raise InputError(f"{name} is not the number of a row", RELOAD)
        return value

    def text(self, name: str) -> str:
        """A text, '' where none is said."""
        value = self._content.get(name, "")
        if not isinstance(value, str) or len(value) > LONGEST:
            raise InputError(f"{name} is no text of up to {LONGEST} characters", RELOAD)
        return value

    def texts(self, name: str) -> dict[str, str]:
        """Texts by their names."""
        value = self._content.get(name)
        if not isinstance(value, dict) or not all(
            isinstance(one, str) and len(one) <= LONGEST for one in value.values()
        ):
            raise InputError(f"{name} holds no texts", RELOAD)
        return {str(key): text for key, text in value.items()}

    def numbers(self, name: str, count: int) -> tuple[float, ...]:
        """So many numbers."""
        value = self._content.get(name)
        found = value if isinstance(value, list) and len(value) == count else [None]
        if not all(isinstance(one, int | float) and abs(one) < MOST for one in found):
            raise InputError(f"{name} are not {count} numbers", "fill in every field, with a point such as 0.02")
        return tuple(float(one or 0.0) for one in found)

    def place(self) -> tuple[float, float]:
        """Column and row, px."""
        found = [self._content.get(name) for name in ("column", "row")]
        if not all(isinstance(one, int | float) and abs(one) < MOST for one in found):
            raise InputError("column and row are no numbers", RELOAD)
        return float(found[0] or 0.0), float(found[1] or 0.0)


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(24)


class Guard:
    """Lets through who knows the token and asks this machine by its own name."""

    def __init__(self, inner: ASGIApp, token: str):
        self._inner, self._token = inner, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._inner(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        if len(scope["path"]) > LONGEST_ADDRESS:
            await PlainTextResponse("The address is too long.", 414, HEADERS)(scope, receive, send)
            return
        _, given, rest = (*scope["path"].split("/", 2), "", "")[:3]
        host = Request(scope).headers.get("host", "").rsplit(":", 1)[0]
        known = secrets.compare_digest(given.encode(), self._token.encode())
        if not known or host not in HOSTS:
            await PlainTextResponse("The address is not that of the bench.", 403, HEADERS)(scope, receive, send)
            return
        await self._inner({**scope, "path": f"/{rest}", "raw_path": f"/{rest}".encode()}, receive, send)


def page(main: str, script: str, kind: str) -> Callable[[Request], Response]:
    """A page of the bench: the frame that all have, with its own part.

    Parameters
    ----------
    main : file of its own part. script : file that fills it. kind : class of the page in the styles.
    """

    def answer(asked: Request) -> Response:
        frame = Template((STATIC / "page.html").read_text(encoding="utf-8"))
        text = frame.substitute(script=script, kind=kind, main=(STATIC / main).read_text(encoding="utf-8"))
        return Response(text, media_type="text/html", headers=HEADERS)

    return answer


def page_file(name: str) -> Callable[[Request], Response]:
    """A file of the page."""

    def answer(asked: Request) -> Response:
        file = STATIC / name
        return Response(file.read_bytes(), media_type=KINDS[file.suffix], headers=HEADERS)

    return answer


def told(work: Callable[[Request], Any]) -> Callable[[Request], Any]:
    """What a piece of work gives as JSON; bad input in words, with 400."""

    async def answer(asked: Request) -> Response:
        try:
            content = await run_in_threadpool(work, asked)
        except InputError as error:
            return JSONResponse({"error": str(error)}, 400, HEADERS)
        return Response(_packed(content), media_type="application/json", headers=HEADERS)

    return answer


def done(work: Callable[[Given], Any]) -> Callable[[Request], Any]:
    """An action with what the page says; what it gives as JSON."""

    async def answer(asked: Request) -> Response:
        try:
            body = await asked.body()
            given = Given(json.loads(body) if body else {})
            content = await run_in_threadpool(work, given)
        except (ValueError, RecursionError):
            return JSONResponse({"error": f"what the page said is no JSON — {RELOAD}"}, 400, HEADERS)
        except InputError as error:
            return JSONResponse({"error": str(error)}, 400, HEADERS)
        return Response(_packed(content), media_type="application/json", headers=HEADERS)

    return answer


def _shown(work: Callable[[Request], bytes]) -> Callable[[Request], Any]:
    """A picture."""

    async def answer(asked: Request) -> Response:
        try:
            content = await run_in_threadpool(work, asked)
        except InputError as error:
            return JSONResponse({"error": str(error)}, 404, HEADERS)
        return Response(content, media_type="image/jpeg", headers=HEADERS | {"Cache-Control": "private, max-age=3600"})

    return answer


def _packed(content: Any) -> bytes:
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode("utf-8")


def _whole(asked: Request, name: str) -> int | None:
    """A whole number of the question; None where it is not asked."""
    text = asked.query_params.get(name, "")
    if not text:
        return None
    if not text.removeprefix("-").isdecimal() or len(text) > 9:
        raise InputError(f"{name} = '{text[:30]}' is not the number of a row", RELOAD)
    return int(text)
