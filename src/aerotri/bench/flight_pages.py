"""The pages of the bench of a planned flight; guarded as those of a result."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.routing import Route
from starlette.types import ASGIApp

from aerotri.bench.flight_bench import FlightBench
from aerotri.bench.server import Given, Guard, done, files_of_page, page, told


def make_flight_application(bench: FlightBench, token: str) -> ASGIApp:
    """The pages of the bench of a plan.

    Parameters
    ----------
    token : first part of every path; whoever does not know it is refused with 403.
    """
    questions: dict[str, Callable[[Request], Any]] = {
        "summary": lambda asked: bench.summary(),
        "content": lambda asked: bench.content(),
        "state": lambda asked: bench.state(),
    }
    actions: dict[str, Callable[[Given], Any]] = {
        "again": lambda given: bench.again(given.texts("fields")),
        "choose": lambda given: bench.choose(given.text("plan")),
        "stop": lambda given: bench.stop(),
    }
    routes = [
        Route("/", page("flight.html", "flight.js", "flight")),
        *files_of_page(),
        *(Route(f"/data/{path}", told(work)) for path, work in questions.items()),
        *(Route(f"/act/{path}", done(work), methods=["POST"]) for path, work in actions.items()),
    ]
    return Guard(Starlette(routes=routes), token)
