"""pycolmap, without the handlers of signals that it puts in place of ours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aerotri.signal_handlers import handlers_kept

if TYPE_CHECKING:
    pycolmap: Any
else:
    with handlers_kept():
        import pycolmap

__all__ = ["pycolmap"]
