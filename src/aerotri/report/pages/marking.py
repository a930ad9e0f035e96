"""A page to mark control points in: pieces of photographs, the predicted place, a click, and the list to save.

The one page of this program with a script; it loads nothing, and names reach it escaped.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from typing import Any

from aerotri.report.pages.head import page_environment

FIRST_PIXEL = 0.5
"""gcp_list.txt counts from the centre of the first pixel."""


def marking_page(crs: str, points: Mapping[str, tuple[float, float, float]], rows: Iterable[dict[str, Any]]) -> str:
    """The page as text.

    Parameters
    ----------
    crs : first line of gcp_list.txt. points : coordinates by name.
    rows : point, image, corner (column, row), predicted and marked (column, row; None), jpeg (bytes) of every piece.
    """
    pieces = [
        {**row, "jpeg": "data:image/jpeg;base64," + base64.b64encode(row["jpeg"]).decode("ascii")} for row in rows
    ]
    environment = page_environment()
    names = [name for name in points if any(piece["point"] == name for piece in pieces)]
    template = environment.get_template("marking.html.j2")
    return template.render(crs=crs, points=dict(points), names=names, pieces=pieces, first_pixel=FIRST_PIXEL)
