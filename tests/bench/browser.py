"""A real browser for the tests: Chromium by Playwright, where both are installed."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


@contextmanager
def served(bench) -> Iterator[str]:
    """The address of the bench, served by a thread."""
    import uvicorn

    from aerotri.bench.serve import ADDRESS, listening
    from aerotri.bench.server import new_token

    token = new_token()
    with listening(0) as listener:
        settings = uvicorn.Config(_pages(bench, token), log_level="error", lifespan="off")
        server = uvicorn.Server(settings)
        thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
        thread.start()
        yield f"http://{ADDRESS}:{listener.getsockname()[1]}/{token}/"
        server.should_exit = True
        thread.join(10)


def _pages(bench, token: str):
    """Those of a result, or of a plan."""
    from aerotri.bench.flight_bench import FlightBench
    from aerotri.bench.flight_pages import make_flight_application
    from aerotri.bench.server import make_application

    return (make_flight_application if isinstance(bench, FlightBench) else make_application)(bench, token)


@contextmanager
def browser() -> Iterator:
    """Chromium; the test is skipped where there is none."""
    found = shutil.which("chromium")
    if found is None:
        pytest.skip("no chromium is installed")
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=ARGUMENTS)
        yield started
        started.close()


class Watched:
    """A page whose requests and errors are kept."""

    def __init__(self, started, width: int = 1400, height: int = 900):
        # Playwright waits by code of its own, which the policy of the page refuses; hostile names have one net less
        context = started.new_context(viewport={"width": width, "height": height}, bypass_csp=True)
        self.page = context.new_page()
        self.hosts: set[str] = set()
        self.errors: list[str] = []
        self.page.on("request", lambda request: self.hosts.add(urlsplit(request.url).hostname or request.url[:5]))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", self._hear)

    def open(self, address: str) -> None:
        self.page.goto(address)
        self.page.wait_for_selector("body[data-ready=yes]")

    def _hear(self, said) -> None:
        """What a refused action is answered with is no error of the page."""
        if said.type == "error" and "400 (Bad Request)" not in said.text:
            self.errors.append(said.text)
