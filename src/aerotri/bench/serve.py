"""The bench on a port of this machine until the user ends it."""

from __future__ import annotations

import signal
import socket
import threading
import webbrowser
from collections.abc import Callable
from types import FrameType

import uvicorn
from starlette.types import ASGIApp

from aerotri.bench.server import new_token
from aerotri.conventions import InputError

ADDRESS = "127.0.0.1"
"""Only this machine: there is no option for another."""


def serve(make: Callable[[str], ASGIApp], port: int, browser: bool, tell: Callable[[str], None]) -> None:
    """Serve the pages until the program is interrupted.

    Parameters
    ----------
    make : the pages for a token. port : 0 for any that is free. browser : whether to open one.
    tell : takes the address.

    Raises
    ------
    InputError
        When the port is taken.
    """
    token = new_token()
    with listening(port) as listener:
        url = f"http://{ADDRESS}:{listener.getsockname()[1]}/{token}/"
        settings = uvicorn.Config(make(token), log_level="error", access_log=False, lifespan="off")
        server = uvicorn.Server(settings)
        thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
        before = {number: signal.signal(number, _ending(server)) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            thread.start()
            tell(url)
            if browser:
                webbrowser.open(url)
            while thread.is_alive():
                thread.join(0.5)
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


def _ending(server: uvicorn.Server) -> Callable[[int, FrameType | None], None]:
    def end(number: int, frame: FrameType | None) -> None:
        server.should_exit = True

    return end


def listening(port: int) -> socket.socket:
    """A socket on this machine alone.

    Parameters
    ----------
    port : 0 for any that is free.

    Raises
    ------
    InputError
        When the port is taken.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((ADDRESS, port))
    except (OSError, OverflowError) as error:
        listener.close()
        raise InputError(f"port {port} cannot be used: {error}", "choose another --port, or leave it out") from None
    listener.listen(64)
    return listener
