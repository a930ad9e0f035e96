"""What was decided since the result that is shown: the page draws it, the next adjustment takes it up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aerotri.bench.decisions import Decision, Decisions
from aerotri.bench.records import Records, pixels_of_rays
from aerotri.formats.block.journal import MARK

SAME_M = 1e-4
SAME_PX = 0.001
"""A mark nearer than this is where it was."""


def open_changes(records: Records, decisions: Decisions) -> list[dict[str, Any]]:
    """Marks and switches that the shown result does not have yet.

    Each with `image` (row, None where the point is meant), `point` (row, None where it is new), `name` of the point,
    `kind` (moved, new, removed, off, on, check, control, new_control or new_check), `px` of a mark, and `reason`.
    """
    rows = _Rows(records)
    found = [_mark(rows, one) for one in decisions.places().values()]
    found += [*_switches(rows, decisions), *_given(rows, decisions)]
    return [one for one in found if one is not None]


class _Rows:
    """Rows of photographs, points and rays by name."""

    def __init__(self, records: Records):
        block = self.block = records.block
        self.images = {name: k for k, name in enumerate(block.images.names.tolist())}
        self.points = {name: k for k, name in enumerate(block.points.tolist())}
        rays = block.image_points
        self.rays = {key: k for k, key in enumerate(zip(rays.image.tolist(), rays.point.tolist(), strict=True))}

    def ray(self, image: str, point: str) -> int:
        """−1 where it is not measured."""
        return self.rays.get((self.images.get(image, -1), self.points.get(point, -1)), -1)

    def position(self, ray: int) -> np.ndarray:
        """(2,) px."""
        return pixels_of_rays(self.block, np.array([ray]), self.block.image_points.xy[[ray]])[0]

    def told(self, one: Decision, kind: str) -> dict[str, Any]:
        return {
            "image": self.images.get(one.image), "point": self.points.get(one.point), "name": one.point, "kind": kind,
            "px": None if one.place is None else list(one.place), "reason": one.reason,
        }  # fmt: skip


def _mark(rows: _Rows, one: Decision) -> dict[str, Any] | None:
    ray = rows.ray(one.image, one.point)
    if one.action != MARK:
        return rows.told(one, "removed") if ray >= 0 else None
    if ray < 0:
        return rows.told(one, "new")
    moved = np.abs(rows.position(ray) - np.array(one.place)).max() > SAME_PX
    return rows.told(one, "moved") if moved else None


def _switches(rows: _Rows, decisions: Decisions) -> list[dict[str, Any]]:
    """Decisions that the block of the result does not have, and such that it has and that were taken back."""
    now, then = decisions.switches(), _switches_of_result(rows)
    found = [rows.told(one, one.action) for key, one in now.items() if then.get(key) != one.action]
    return found + [rows.told(Decision("on", image, point), "on") for image, point in then if (image, point) not in now]


def _given(rows: _Rows, decisions: Decisions) -> list[dict[str, Any]]:
    """New control and check points that the result does not have with these coordinates."""
    control = rows.block.control
    there = dict(zip(rows.block.points[control.point].tolist(), control.xyz, strict=True))
    return [
        rows.told(one, one.action)
        for name, one in decisions.given().items()
        if name not in there or not np.allclose(there[name], (one.given or ())[:3], rtol=0.0, atol=SAME_M)
    ]


def _switches_of_result(rows: _Rows) -> Mapping[tuple[str, str], str]:
    edits, block = rows.block.edits, rows.block
    if edits is None:
        return {}
    return {
        ("" if image < 0 else str(block.images.names[image]), str(block.points[point])): str(action)
        for image, point, action in zip(edits.image.tolist(), edits.point.tolist(), edits.action.tolist(), strict=True)
    }
