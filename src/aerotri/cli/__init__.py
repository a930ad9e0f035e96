"""The command lines: thin, each a few lines around the package; heavy imports only where they are used."""

from __future__ import annotations

import os
import sys

from aerotri.cli import adjusting, blocks, image_errors, run, terrain, volumes
from aerotri.cli.app import app
from aerotri.conventions import InputError

__all__ = ["adjusting", "app", "blocks", "image_errors", "main", "run", "terrain", "volumes"]


def main() -> None:
    """Entry point: bad input is one line and exit 2, a failed adjustment its status and exit 1."""
    try:
        app()
    except InputError as error:
        print(f"aerotri: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except BrokenPipeError:
        raise SystemExit(0) from None
    except Exception as error:
        if os.environ.get("AEROTRI_DEBUG"):
            raise
        text = f"aerotri: unexpected {type(error).__name__}: {error} — please report it; AEROTRI_DEBUG=1 tells where"
        print(text, file=sys.stderr)
        raise SystemExit(1) from None
    except KeyboardInterrupt:
        print("aerotri: interrupted, nothing was written", file=sys.stderr)
        raise SystemExit(130) from None
