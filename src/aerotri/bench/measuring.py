"""Decisions at the bench: marks set, moved and removed, rays and points switched, new points, undo."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from aerotri.bench.changed import open_changes
from aerotri.bench.decisions import NAME, Decision, Decisions
from aerotri.bench.pictures import Pictures
from aerotri.bench.places import Places
from aerotri.bench.rays import ray_rows
from aerotri.bench.shown import RELOAD, Shown
from aerotri.bench.snap import snapped
from aerotri.bench.target_search import point_of_number, targets_of_photograph
from aerotri.conventions import InputError
from aerotri.formats.block.journal import GIVEN, MARK, ON, REMOVE
from aerotri.observations.block import EDIT_ACTIONS


class Measuring:
    """What the user decides; every method may be called from any thread.

    Parameters
    ----------
    shown : what the pages show now. places : the folders. pictures : the photographs.
    """

    def __init__(self, shown: Callable[[], Shown], places: Places, pictures: Pictures):
        self._shown, self._places, self._pictures = shown, places, pictures
        self._lock = threading.RLock()
        self.decisions = Decisions(places.readable_block)

    def edits(self) -> dict[str, Any]:
        """The journal, the newest first, what the shown result does not have of it, and the new control points."""
        standing = {id(one) for one in self.decisions.standing()}
        rows = [
            {"time": one.time, "action": one.action, "image": one.image, "point": one.point, "place": one.place,
             "before": one.before, "reason": one.reason, "stands": id(one) in standing}
            for one in reversed(self.decisions.rows)
        ]  # fmt: skip
        return {"rows": rows, "changes": open_changes(self._shown().records, self.decisions),
                "file": str(self._places.block / NAME), "can_undo": bool(standing)}  # fmt: skip

    def mark(
        self, image: int, point: str, place: tuple[float, float], reason: str = "", snap: bool = False
    ) -> dict[str, Any]:
        """Set or move a mark; `snapped` says in words where it was brought to, `read` which number a target there has.

        `named` is the control point of that number, '' where there is none.

        Parameters
        ----------
        image : row. point : name, of the block or a new one. place : column and row, px.
        snap : whether a target or the other photographs of the point say more exactly where it is.

        Raises
        ------
        InputError
            When the place is not in the photograph.
        """
        shown = self._shown()
        row = shown.image_row(image)
        size = self._pictures.size(row)
        if not all(0.0 <= value <= limit for value, limit in zip(place, size, strict=True)):
            raise InputError("the place is not in the photograph", "click inside of it")
        name, how, number = _name(point), "", None
        if snap and row in self._pictures:
            found = snapped(self._pictures, row, place, self._others(name), shown.prediction(), shown.xyz(name))
            place, how, number = found.place, found.how, found.number
        said = " ".join(filter(None, (reason, how)))
        decided = self._decide(Decision(MARK, shown.image(row), name, place, self._place(row, name), said))
        return decided | {"snapped": how, "read": number, "named": point_of_number(self._control_names(), number)}

    def targets(self, image: int) -> dict[str, Any]:
        """The coded targets of a photograph, with the control point that each number names.

        Raises
        ------
        InputError
            When there is no file of the photograph.
        """
        row, names = self._shown().image_row(image), self._control_names()
        return {"targets": [
            {"family": one.family, "number": one.number, "place": np.round(one.place, 3).tolist(),
             "sigma": round(one.sigma_px, 3), "point": point_of_number(names, one.number)}
            for one in targets_of_photograph(self._pictures, row)
        ]}  # fmt: skip

    def mark_targets(self, image: int) -> dict[str, Any]:
        """Mark every control point whose number a coded target of the photograph has; `marked` names them.

        A number that two targets have is left out.

        Raises
        ------
        InputError
            When there is no file of the photograph.
        """
        shown, marked = self._shown(), list[str]()
        row = shown.image_row(image)
        found = [one for one in self.targets(row)["targets"] if one["point"]]
        points = [one["point"] for one in found]
        for one in found:
            column, line = one["place"]
            if points.count(one["point"]) == 1:
                before = self._place(row, one["point"])
                said = f"coded target {one['number']} ({one['family']}), σ {one['sigma']:.2f} px"
                self._decide(Decision(MARK, shown.image(row), one["point"], (column, line), before, said))
                marked.append(one["point"])
        return self.edits() | {"marked": marked}

    def give(self, point: str, action: str, given: tuple[float, ...], reason: str = "") -> dict[str, Any]:
        """Make a point a control or check point.

        Parameters
        ----------
        point : its name, of a tie point or a new one. action : new_control or new_check.
        given : m, X, Y, Z and their σ, in the CRS of the block.

        Raises
        ------
        InputError
            When the point is one already, or a σ is not above 0.
        """
        name = _name(point)
        if action not in GIVEN:
            raise InputError(f"'{action[:30]}' makes no point", RELOAD)
        if name in self._control_names() and name not in self.decisions.given():
            raise InputError(f"'{name}' is a control or check point already", "give the new point another name")
        if len(given) != 6 or not min(given[3:]) > 0.0:
            raise InputError("a standard deviation is not above 0", "give σ of X, Y and Z in m")
        return self._decide(Decision(action, "", name, reason=reason, given=given))

    def remove(self, image: int, point: str, reason: str) -> dict[str, Any]:
        """Take a measurement out.

        Raises
        ------
        InputError
            When the point is not measured there.
        """
        shown = self._shown()
        row = shown.image_row(image)
        before = self._place(row, point)
        if before is None:
            raise InputError(f"'{point}' is not measured there", RELOAD)
        return self._decide(Decision(REMOVE, shown.image(row), point, None, before, reason))

    def switch(self, image: int | None, point: str, action: str, reason: str) -> dict[str, Any]:
        """Switch a ray off or on, or change what a control point is used for; with a reason.

        Parameters
        ----------
        image : row, None where the point as a whole is meant. action : off, on, check or control.

        Raises
        ------
        InputError
        """
        shown = self._shown()
        block = shown.records.block
        if action not in (*EDIT_ACTIONS, ON):
            raise InputError(f"'{action[:30]}' is no decision about a ray or a point", RELOAD)
        if not reason.strip():
            raise InputError("a decision needs a reason", "say why, in a few words")
        if action in ("check", "control") and (image is not None or point not in block.points[block.control.point]):
            raise InputError(f"'{point}' is no control or check point", "choose one of control.csv")
        name = "" if image is None else shown.image(shown.image_row(image))
        known = point in block.points if image is None else self._place(image, point) is not None
        if not known:
            raise InputError(f"'{point}' is not measured there", RELOAD)
        return self._decide(Decision(action, name, point, reason=reason))

    def undo(self) -> dict[str, Any]:
        """Take the last decision back."""
        with self._lock:
            self.decisions.undo()
            return self.edits()

    def _decide(self, decision: Decision) -> dict[str, Any]:
        with self._lock:
            if self.decisions.folder != self._places.block:
                self._places.keep_block()
                self.decisions = Decisions(self._places.block)
            self.decisions.add(decision)
            return self.edits()

    def _others(self, point: str) -> list[tuple[int, np.ndarray]]:
        """Photographs and places (2,) px where a point is measured now, the smallest |w| first."""
        records, found = self._shown().records, dict[int, np.ndarray]()
        block = records.block
        rows = np.flatnonzero(block.points[block.image_points.point] == point)
        rows = rows[np.argsort(np.nan_to_num(records.size[rows], nan=np.inf))]
        rays = ray_rows(records, rows)
        for image, px in zip(rays["image"], rays["px"], strict=True):
            found[image] = np.array(px)
        row = {name: k for k, name in enumerate(block.images.names.tolist())}
        for (image, name), one in self.decisions.places().items():
            if name == point and image in row:
                found.pop(row[image], None)
                if one.place is not None:
                    found[row[image]] = np.array(one.place)
        return list(found.items())

    def _control_names(self) -> list[str]:
        """Names of the control and check points, the new ones too."""
        block = self._shown().records.block
        return [*map(str, block.points[block.control.point].tolist()), *self.decisions.given()]

    def _place(self, image: int, point: str) -> tuple[float, float] | None:
        """Column and row of a mark as it is now; None where the point is not measured."""
        shown = self._shown()
        last = self.decisions.places().get((shown.image(image), point))
        if last is not None:
            return last.place
        block = shown.records.block
        rows = np.flatnonzero((block.image_points.image == image) & (block.points[block.image_points.point] == point))
        if not len(rows):
            return None
        column, row = ray_rows(shown.records, rows)["px"][0]
        return column, row


def _name(point: str) -> str:
    """The name of a point as it is kept."""
    name = point.strip()
    if not name or len(name) > 200 or not name.isprintable():
        raise InputError("a point needs a name of up to 200 printable characters", "give it one")
    return name
