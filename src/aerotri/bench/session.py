"""One bench: the block and its result, what is looked at, decided, and adjusted behind the page."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.bench.changed import open_changes
from aerotri.bench.decisions import NAME, Decision, Decisions
from aerotri.bench.difference import difference_content
from aerotri.bench.equations import Equations
from aerotri.bench.job import Job
from aerotri.bench.layers import layer_picture, layers_beside, open_layer
from aerotri.bench.next_mark import NextMark, next_marks
from aerotri.bench.pictures import Pictures
from aerotri.bench.places import Places
from aerotri.bench.plan import ellipse_content, plan_content, plan_origin
from aerotri.bench.prediction import Prediction
from aerotri.bench.rays import MOST_ROWS, chosen_rays, order_of_rays, point_content, ray_rows
from aerotri.bench.records import read_records, records_of_block
from aerotri.bench.rough_prediction import RoughPrediction, rough_prediction
from aerotri.bench.snap import snapped
from aerotri.bench.target_search import point_of_number, targets_of_photograph
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block
from aerotri.formats.block.journal import GIVEN, MARK, ON, REMOVE
from aerotri.observations.block import EDIT_ACTIONS
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.outliers import spread
from aerotri.statistics.reliability import critical_value

LARGEST_CUTOUT, MOST_NEXT = 1024, 20
RELOAD = "load the page again"


class Bench:
    """What the pages ask for; every method may be called from any thread.

    Parameters
    ----------
    places : the folders. photographs : the folder of the photographs, None where there are none.
    below : rasters to be drawn below the plan, beside those of `aerotri run`.

    Raises
    ------
    InputError
        When the result or the block is damaged, or the folder has no photographs of the block.
    """

    def __init__(self, places: Places, photographs: Path | None = None, below: Sequence[Path] = ()):
        self.places = places
        self._lock = threading.RLock()
        self.generation = 0
        self._before: Equations | None = None
        self._job: Job | None = None
        self._next: tuple[Adjustment, list[NextMark]] | None = None
        self.show(places.result)
        self.pictures = Pictures(self.records.block, photographs)
        self.decisions = Decisions(places.readable_block)
        self._layers = [open_layer(path) for path in (*below, *layers_beside(places.result))]

    def show(self, result: Path | None) -> None:
        """Take up a result, or the block alone."""
        records = records_of_block(read_block(self.places.readable_block)) if result is None else read_records(result)
        with self._lock:
            self.result, self.records = result, records
            self.order = order_of_rays(records)
            self.generation += 1
            self.equations = Equations(result)
            self._rough = rough_prediction(records.block) if result is None else None

    def summary(self) -> dict[str, Any]:
        """What the head of the page says."""
        r, o = self.records, self.records.outcome
        return {
            "name": str(r.block.name), "result": "" if self.result is None else self.result.name,
            "status": o.get("status", "not adjusted"), "verdict": o.get("verdict", ""),
            "reasons": o.get("reasons", []), "sigma0": o.get("sigma0"), "sigma0_um": o.get("sigma0_um"),
            "limit": spread(r.w) * critical_value(r.block.settings.adjustment.alpha), "counts": r.block.counts,
            "crs": r.block.crs, "generation": self.generation,
            "sizes": [list(camera.size_px) for camera in r.block.cameras], "camera": r.block.images.camera.tolist(),
            "is_rough": self._rough is not None, "compared": self._before is not None,
            "pictures": sorted(self.pictures.paths()),
        }  # fmt: skip

    def state(self) -> dict[str, Any]:
        """What goes on: asked for every second."""
        job = None if self._job is None else self._job.state()
        return {"generation": self.generation, "equations": self.equations.state(), "job": job}

    def plan(self) -> dict[str, Any]:
        """See `plan_content`."""
        return plan_content(self.records)

    def ellipses(self) -> dict[str, Any]:
        """See `ellipse_content`.

        Raises
        ------
        InputError
            When the equations are not there yet.
        """
        return ellipse_content(self.equations.get().result)

    def rays(self, first: int, image: int | None, point: int | None, text: str) -> dict[str, Any]:
        """A page of the table of rays from row `first` on."""
        for given, count, what in ((image, len(self.records.block.images), "photograph"),
                                   (point, len(self.records.block.points), "point")):  # fmt: skip
            if given is not None:
                self._row(given, count, what)
        rows = chosen_rays(self.records, self.order, image, point, text)
        return {"count": len(rows), "first": first, "rows": ray_rows(self.records, rows[first : first + MOST_ROWS])}

    def point(self, point: int) -> dict[str, Any]:
        """See `point_content`; with where it is expected in all photographs that show it, once that is known.

        Raises
        ------
        InputError
        """
        row = self._row(point, len(self.records.block.points), "point")
        return point_content(self.records, row) | {"expected": self._expected(row)}

    def photograph(self, image: int) -> dict[str, Any]:
        """The rays of a photograph, and where control points are expected in it, once that is known.

        Raises
        ------
        InputError
        """
        block = self.records.block
        row = self._row(image, len(block.images), "photograph")
        rows = np.flatnonzero(block.image_points.image == row)
        control, expected = block.control.point, list[Any]()
        prediction = self._prediction()
        if prediction is not None and len(control):
            xyz = np.where(np.isnan(self.records.xyz[control]), block.control.xyz, self.records.xyz[control])
            px = prediction.pixels(row, xyz)
            expected = [[int(p), *np.round(at, 3).tolist()] for p, at in zip(control, px, strict=True)
                        if np.isfinite(at).all()]  # fmt: skip
        return {
            "image": row, "name": str(block.images.names[row]), "size": list(self.pictures.size(row)),
            "has_file": row in self.pictures, "rays": ray_rows(self.records, rows), "expected": expected,
        }  # fmt: skip

    def cutout(self, image: int, left: int, top: int, size: int) -> bytes:
        """A square of a photograph in full resolution, as JPEG.

        Raises
        ------
        InputError
        """
        if not 8 <= size <= LARGEST_CUTOUT:
            raise InputError(f"a cut-out of {size} pixels cannot be shown", f"8 to {LARGEST_CUTOUT} can")
        return self.pictures.cutout(self._row(image, len(self.records.block.images), "photograph"), left, top, size)

    def layers(self) -> dict[str, Any]:
        """Surfaces and orthophotos to be drawn below the plan: name and bounds, from the origin of the plan."""
        origin = plan_origin(self.records)[:2].tolist() * 2
        return {"layers": [
            {"name": one.path.name, "bounds": [value - zero for value, zero in zip(one.bounds, origin, strict=True)]}
            for one in self._layers
        ]}  # fmt: skip

    def layer(self, number: int) -> bytes:
        """The picture of a layer, as JPEG.

        Raises
        ------
        InputError
        """
        return layer_picture(self._layers[self._row(number, len(self._layers), "layer")])

    def epipolar(self, image: int, point: int) -> dict[str, Any]:
        """The rays of a point in other photographs as lines in this one.

        Raises
        ------
        InputError
        """
        prediction, r = self.equations.prediction(), self.records
        row = self._row(image, len(r.block.images), "photograph")
        own = self._row(point, len(r.block.points), "point")
        if prediction is None or not np.isfinite(r.xyz[own]).all():
            return {"lines": []}
        rays = ray_rows(r, np.flatnonzero((r.block.image_points.point == own) & (r.block.image_points.image != row)))
        lines = [
            {"image": other, "line": np.round(prediction.epipolar(row, other, np.array(px), r.xyz[own]), 2).tolist()}
            for other, px in zip(rays["image"], rays["px"], strict=True)
        ]
        return {"lines": [one for one in lines if len(one["line"]) > 1]}

    def next(self) -> dict[str, Any]:
        """Which mark next: see `next_marks`; those that were set meanwhile are left out.

        Raises
        ------
        InputError
            When the equations are not there yet.
        """
        adjustment, prediction = self.equations.get(), self.equations.prediction()
        if prediction is None:
            raise InputError("the equations are not there", "wait a moment")
        if self._next is None or self._next[0] is not adjustment:
            self._next = (adjustment, next_marks(adjustment, prediction))
        names, touched = adjustment.result.block.points, self.decisions.places()
        return {"marks": [
            {"image": one.image, "point": one.point, "place": list(one.place), "is_control": one.is_control,
             "before": one.before, "after": one.after}
            for one in self._next[1] if (self._image(one.image), str(names[one.point])) not in touched
        ][:MOST_NEXT]}  # fmt: skip

    def edits(self) -> dict[str, Any]:
        """The journal, the newest first, what the shown result does not have of it, and the new control points."""
        standing = {id(one) for one in self.decisions.standing()}
        rows = [
            {"time": one.time, "action": one.action, "image": one.image, "point": one.point, "place": one.place,
             "before": one.before, "reason": one.reason, "stands": id(one) in standing}
            for one in reversed(self.decisions.rows)
        ]  # fmt: skip
        return {"rows": rows, "changes": open_changes(self.records, self.decisions),
                "file": str(self.places.block / NAME), "can_undo": bool(standing)}  # fmt: skip

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
        row = self._row(image, len(self.records.block.images), "photograph")
        size = self.pictures.size(row)
        if not all(0.0 <= value <= limit for value, limit in zip(place, size, strict=True)):
            raise InputError("the place is not in the photograph", "click inside of it")
        name, how, number = _name(point), "", None
        if snap and row in self.pictures:
            found = snapped(self.pictures, row, place, self._others(name), self._prediction(), self._xyz(name))
            place, how, number = found.place, found.how, found.number
        said = " ".join(filter(None, (reason, how)))
        decided = self._decide(Decision(MARK, self._image(row), name, place, self._place(row, name), said))
        return decided | {"snapped": how, "read": number, "named": point_of_number(self._control_names(), number)}

    def targets(self, image: int) -> dict[str, Any]:
        """The coded targets of a photograph, with the control point that each number names.

        Raises
        ------
        InputError
            When there is no file of the photograph.
        """
        row, names = self._row(image, len(self.records.block.images), "photograph"), self._control_names()
        return {"targets": [
            {"family": one.family, "number": one.number, "place": np.round(one.place, 3).tolist(),
             "sigma": round(one.sigma_px, 3), "point": point_of_number(names, one.number)}
            for one in targets_of_photograph(self.pictures, row)
        ]}  # fmt: skip

    def mark_targets(self, image: int) -> dict[str, Any]:
        """Mark every control point whose number a coded target of the photograph has; `marked` names them.

        A number that two targets have is left out.

        Raises
        ------
        InputError
            When there is no file of the photograph.
        """
        row, marked = self._row(image, len(self.records.block.images), "photograph"), list[str]()
        found = [one for one in self.targets(row)["targets"] if one["point"]]
        points = [one["point"] for one in found]
        for one in found:
            column, line = one["place"]
            if points.count(one["point"]) == 1:
                before = self._place(row, one["point"])
                said = f"coded target {one['number']} ({one['family']}), σ {one['sigma']:.2f} px"
                self._decide(Decision(MARK, self._image(row), one["point"], (column, line), before, said))
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
        row = self._row(image, len(self.records.block.images), "photograph")
        before = self._place(row, point)
        if before is None:
            raise InputError(f"'{point}' is not measured there", RELOAD)
        return self._decide(Decision(REMOVE, self._image(row), point, None, before, reason))

    def switch(self, image: int | None, point: str, action: str, reason: str) -> dict[str, Any]:
        """Switch a ray off or on, or change what a control point is used for; with a reason.

        Parameters
        ----------
        image : row, None where the point as a whole is meant. action : off, on, check or control.

        Raises
        ------
        InputError
        """
        block = self.records.block
        if action not in (*EDIT_ACTIONS, ON):
            raise InputError(f"'{action[:30]}' is no decision about a ray or a point", RELOAD)
        if not reason.strip():
            raise InputError("a decision needs a reason", "say why, in a few words")
        if action in ("check", "control") and (image is not None or point not in block.points[block.control.point]):
            raise InputError(f"'{point}' is no control or check point", "choose one of control.csv")
        name = "" if image is None else self._image(self._row(image, len(block.images), "photograph"))
        known = point in block.points if image is None else self._place(image, point) is not None
        if not known:
            raise InputError(f"'{point}' is not measured there", RELOAD)
        return self._decide(Decision(action, name, point, reason=reason))

    def undo(self) -> dict[str, Any]:
        """Take the last decision back."""
        with self._lock:
            self.decisions.undo()
            return self.edits()

    def adjust(self) -> dict[str, Any]:
        """Adjust the block as it is now, behind the page.

        Raises
        ------
        InputError
            When an adjustment is running already.
        """
        with self._lock:
            if self._job is not None and self._job.is_running:
                raise InputError("an adjustment is running already", "wait, or stop it")
            self.places.keep_block()
            frame = self.equations.frame()
            geoid = "" if frame is None or frame.geoid is None else str(frame.geoid)
            out = self.places.next_result()
            words = [str(self.places.block), str(out), "" if self.result is None else str(self.result), geoid]
            self._job = Job("aerotri.bench.worker", words, out, self._take)
        return self.state()

    def stop(self) -> dict[str, Any]:
        """Stop the adjustment that is running."""
        if self._job is not None and self._job.is_running:
            self._job.stop()
        return self.state()

    def wait(self) -> None:
        """Wait until the adjustment has ended and the equations are there."""
        if self._job is not None:
            self._job.wait()
        self.equations.wait()

    def difference(self, top: int = 10) -> dict[str, Any]:
        """What the last adjustment changed; see `difference_content`.

        Raises
        ------
        InputError
            When nothing was adjusted here, or the equations are not there yet.
        """
        if self._before is None:
            raise InputError("nothing was adjusted here yet", "press Adjust again")
        return difference_content(self._before.get().result, self.equations.get().result, top)

    def _take(self, result: Path) -> None:
        """Show a new result; the one before is what it is compared with."""
        before = self.equations if self.result is not None else None
        with self._lock:
            self._before = before
            self.show(result)

    def _decide(self, decision: Decision) -> dict[str, Any]:
        with self._lock:
            if self.decisions.folder != self.places.block:
                self.places.keep_block()
                self.decisions = Decisions(self.places.block)
            self.decisions.add(decision)
            return self.edits()

    def _prediction(self) -> Prediction | RoughPrediction | None:
        """Where points appear: by the adjustment, before the first one by what is given; None where neither is."""
        return self.equations.prediction() or self._rough

    def _expected(self, point: int) -> list[Any]:
        """Photograph, column and row of everywhere that a point should appear."""
        prediction, xyz = self._prediction(), self._xyz(str(self.records.block.points[point]))
        if prediction is None or xyz is None or not np.isfinite(xyz).all():
            return []
        return [
            [image, *np.round(prediction.pixels(image, xyz[None])[0], 3).tolist()]
            for image in prediction.images_of(xyz).tolist()
        ]

    def _xyz(self, point: str) -> np.ndarray | None:
        """(3,) m of a point, as it is adjusted, or given; None where neither."""
        r = self.records
        rows = np.flatnonzero(r.block.points == point)
        if not len(rows):
            return None
        given = np.flatnonzero(r.block.control.point == rows[0])
        if not np.isfinite(r.xyz[rows[0]]).all() and len(given):
            return r.block.control.xyz[given[0]]
        return r.xyz[rows[0]]

    def _others(self, point: str) -> list[tuple[int, np.ndarray]]:
        """Photographs and places (2,) px where a point is measured now, the smallest |w| first."""
        block, found = self.records.block, dict[int, np.ndarray]()
        rows = np.flatnonzero(block.points[block.image_points.point] == point)
        rows = rows[np.argsort(np.nan_to_num(self.records.size[rows], nan=np.inf))]
        rays = ray_rows(self.records, rows)
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
        block = self.records.block
        return [*map(str, block.points[block.control.point].tolist()), *self.decisions.given()]

    def _place(self, image: int, point: str) -> tuple[float, float] | None:
        """Column and row of a mark as it is now; None where the point is not measured."""
        last = self.decisions.places().get((self._image(image), point))
        if last is not None:
            return last.place
        block = self.records.block
        rows = np.flatnonzero((block.image_points.image == image) & (block.points[block.image_points.point] == point))
        if not len(rows):
            return None
        column, row = ray_rows(self.records, rows)["px"][0]
        return column, row

    def _image(self, row: int) -> str:
        return str(self.records.block.images.names[row])

    def _row(self, number: int, count: int, what: str) -> int:
        if not 0 <= number < count:
            raise InputError(f"there is no {what} {number}", RELOAD)
        return number


def _name(point: str) -> str:
    """The name of a point as it is kept."""
    name = point.strip()
    if not name or len(name) > 200 or not name.isprintable():
        raise InputError("a point needs a name of up to 200 printable characters", "give it one")
    return name
