"""pyarrow's compute functions, imported when needed and out of sight of type checkers, which do not know them."""

from __future__ import annotations

from typing import Any


def arrow_compute() -> Any:
    """The module pyarrow.compute; it makes its functions while being imported."""
    from pyarrow import compute

    return compute
