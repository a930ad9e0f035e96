"""A flight planned over an area, with its accuracy and the control that it needs."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from aerotri.conventions import FilePath, InputError, real_path
from aerotri.observations import Block
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.projects import project_of
from aerotri.public.table import Table
from aerotri.results.head import Head

if TYPE_CHECKING:
    from aerotri.planning.ground import Ground
    from aerotri.planning.plan import PlanRecord

RECORD, REQUEST = "plan.json", "request.json"
PLAN_NAMES = (
    RECORD, REQUEST, "plan.html", "plan.gpkg", "plan.kml", "waypoints.csv", "sigma_z.tif", "block",
)  # fmt: skip
FILES = ("area", "camera", "dem", "control", "piles", "project")
"""Arguments of `plan_flight` that may name a file."""


@dataclass(frozen=True, eq=False, repr=False)
class FlightPlan:
    """A planned flight and the accuracy to be expected of it.

    Parameters
    ----------
    record : what was planned. head : of page and file. request : arguments of `plan_flight` that it was made with.
    """

    record: PlanRecord
    head: Head = field(default_factory=Head)
    request: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without a target."""
        return self.record.met

    @property
    def summary(self) -> dict[str, Any]:
        """What plan.json holds."""
        from aerotri.planning.plan_json import plan_json

        return self.head.as_dict() | plan_json(self.record)

    @property
    def exposures(self) -> Table:
        """A row an exposure, in the order flown; m, degrees clockwise from grid north, s."""
        f = self.record.flight
        columns = {
            "image": f.names, "strip": f.strip, "X": f.centre[:, 0], "Y": f.centre[:, 1], "Z": f.centre[:, 2],
            "height_above_ground": f.centre[:, 2] - f.ground, "heading": np.degrees(f.heading), "time": f.time,
        }  # fmt: skip
        units = dict.fromkeys(("X", "Y", "Z", "height_above_ground"), "m") | {"heading": "deg", "time": "s"}
        return Table.of("exposures", columns, units)

    @property
    def ground_points(self) -> Table:
        """A row a ground point of the map: place, σ, the part of σ_Z that neighbours share, photographs; m."""
        r = self.record
        columns = {"point": r.block.points[r.expected.ground]}
        columns |= {axis: r.ground_points[:, k] for k, axis in enumerate("XYZ")}
        columns |= {f"s{axis}": r.sigma[:, k] for k, axis in enumerate("XYZ")}
        columns |= {"shared_sZ": r.deformation[:, 2], "rays": r.rays}
        return Table.of("ground points", columns, dict.fromkeys((*columns,)[1:-1], "m"))

    @property
    def control(self) -> Table:
        """A row a control point, those added in the order of their gain; m, or m³ for a target of the volume."""
        rows = self.summary["control"]
        names = ("point", "X", "Y", "Z", "order", "before", "after")
        columns = {name: [np.nan if row[name] is None else row[name] for row in rows] for name in names}
        return Table.of("control", columns, dict.fromkeys("XYZ", "m"))

    @property
    def expected_block(self) -> Block:
        """The block that the flight will bring, free of error; ground points of the map are its check points."""
        return self.record.block

    @property
    def piles(self) -> Table:
        """A row a pile: size, m², and σ of its volume to be expected, m³; empty where the area is one polygon."""
        rows = self.record.piles
        columns = {"pile": [one.name for one in rows], "area": [one.area for one in rows],
                   "sigma": [one.sigma for one in rows]}  # fmt: skip
        return Table.of("piles", columns, {"area": "m²", "sigma": "m³"})

    def fly(self, seed: int = 1) -> Block:
        """The block of one simulated flight: image points, control and positions have errors of their σ.

        Parameters
        ----------
        seed : 0 or more; another one gives other errors.

        Raises
        ------
        InputError
            For a negative seed.
        """
        from aerotri.planning.expected_block import measured

        if seed < 0:
            raise InputError(f"the seed {seed} is negative", "give 0 or more")
        return measured(self.record.block, seed)

    def html(self) -> str:
        """The page as text."""
        from aerotri.report.pages.plan import plan_html

        return plan_html(self.record, self.head)

    def save(self, out: FilePath) -> Path:
        """Write page, numbers, GeoPackage, KML (with a CRS), waypoints, the raster of σ, and one flight as a block.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        from aerotri.formats.block.folder import write_block
        from aerotri.formats.files.atomic import atomic_folder
        from aerotri.formats.results.json_text import write_json
        from aerotri.planning.expected_block import truth_of
        from aerotri.planning.layers import kml_text, plan_layers, waypoints_text, write_sigma
        from aerotri.simulation.truth import write_truth
        from aerotri.vectors.geopackage_writer import write_geopackage

        r, target = self.record, Path(out)
        refuse_foreign_folder(target, RECORD)
        kml = kml_text(r)
        with atomic_folder(target, own=PLAN_NAMES, gone=() if kml else ("plan.kml",)) as folder:
            write_json(folder / RECORD, self.summary)
            write_json(folder / REQUEST, dict(self.request))
            (folder / "plan.html").write_text(self.html(), encoding="utf-8")
            write_geopackage(folder / "plan.gpkg", plan_layers(r), r.area.crs)
            if kml is not None:
                (folder / "plan.kml").write_text(kml, encoding="utf-8")
            (folder / "waypoints.csv").write_text(waypoints_text(r), encoding="utf-8")
            write_sigma(r, folder / "sigma_z.tif")
            (folder / "block").mkdir()
            write_block(self.fly(), folder / "block", rounded=True)
            write_truth(folder / "block", r.block, truth_of(r.expected, r.flight, r.camera))
        return target

    def __repr__(self) -> str:
        f = self.record.flight
        return f"<aerotri flight plan of {self.record.area.name!r}: {len(f)} photographs in {len(f.strips)} strips>"

    def _repr_html_(self) -> str:
        return self.control.html()


def plan_flight(
    area: str | FilePath,
    *,
    camera: str | FilePath,
    gsd: float,
    dem: FilePath | None = None,
    ground: float | None = None,
    crs: str | None = None,
    forward_overlap: float = 0.8,
    side_overlap: float = 0.6,
    direction: float | None = None,
    cross_strips: int = 0,
    height_mode: Literal["constant", "follow"] = "constant",
    rays: int = 3,
    speed: float = 10.0,
    turn: float = 15.0,
    interval: float = 0.0,
    positions_sigma: tuple[float, float] | None = None,
    control: int | Literal["auto"] | FilePath = "auto",
    control_sigma: tuple[float, float] = (0.02, 0.03),
    most_control: int = 30,
    self_calibration: str = "none",
    target: str | None = None,
    tie_points: int = 200,
    tie_probability: float = 0.6,
    image_sigma: float = 0.5,
    most_photographs: int = 1500,
    piles: str | FilePath | None = None,
    project: FilePath | None = None,
    progress: Callable[[str], None] | None = None,
) -> FlightPlan:
    """A flight over an area, its accuracy predicted, and control added where it helps most.

    The block that the flight will bring is made at its true values and its normal equations are set up as the
    adjustment does. The covariance of ground points over the area follows from them: nothing is drawn at random but the
    places of tie points.

    Parameters
    ----------
    area : file of polygons as for `aerotri.volume`, or WKT text.
    camera : name of a camera that `aerotri simulate` knows, or a TOML file with one table [camera.NAME].
    gsd : m, size of a pixel on the mean ground.
    dem : GeoTIFF with the heights of the ground. ground : m, level of a plane; one of the two.
    crs : 'EPSG:n' of the plan, in metres; None for that of the DEM or of the area, for an area in degrees its UTM zone.
    forward_overlap, side_overlap : 0 to 0.95, held over all ground of the area.
    direction : deg clockwise from grid north; None for along the longest side of the area.
    cross_strips : strips across the others.
    height_mode : one altitude for all strips, or one for each over its own mean ground.
    rays : photographs that every place of the area lies in, at least.
    speed : m/s. turn : s from the end of a strip to the next. interval : s that the camera needs between exposures.
    positions_sigma : m, σ of X and Y and of Z of the camera positions by GNSS; None without.
    control : number of control points to add; 'auto' for as many as the target needs; a table as control.csv for those
        that are there, to which as many are added as the target needs.
    control_sigma : m, σ of X and Y and of Z of control points.
    most_control : control points that are added at most.
    self_calibration : additional parameters as in block.toml; with a named camera also the interior orientation, with σ
        of a thousandth of the principal distance.
    target : 'asprs 5cm' (RMSE_H and RMSE_V), 'sigma-z 0.03' (m, on 95 % of the area) or 'sigma-volume 20' (m³).
    tie_points : image points expected in a photograph. tie_probability : that a photograph that sees a tie point
        measures it. image_sigma : px, σ of an image coordinate.
    most_photographs : a plan of more is refused.
    piles : polygons of piles whose volumes are wanted one by one, as `area`; those of the area where it has several.
    project : block, or result of an adjustment, whose [project] stands at the head of page and file.
    progress : is given the name of each step.

    Returns
    -------
    FlightPlan

    Raises
    ------
    InputError
        When the area, the DEM or a number cannot be used, or the block would have no datum.

    Examples
    --------
    >>> import aerotri
    >>> area = "POLYGON ((0 0, 300 0, 300 200, 0 200, 0 0))"
    >>> plan = aerotri.plan_flight(area, camera="p1", gsd=0.03, ground=100.0, target="sigma-z 0.06")
    >>> plan.met
    True
    """
    request = _request(locals())
    from aerotri.planning.area import read_area, with_piles
    from aerotri.planning.cameras import camera_of_plan
    from aerotri.planning.given_control import NONE, read_given_control
    from aerotri.planning.options import PlanOptions, parse_target
    from aerotri.planning.plan import make_plan

    options = PlanOptions(
        gsd, forward_overlap, side_overlap, direction, cross_strips, height_mode, rays, speed, turn, interval,
        positions_sigma, tie_points, image_sigma, tie_probability, control_sigma, self_calibration, most_photographs,
    ).checked()  # fmt: skip
    goal = None if target is None else parse_target(target)
    given, wanted = NONE, None
    if isinstance(control, int):
        wanted = control
    elif control != "auto":
        given = read_given_control(Path(control), control_sigma)
        wanted = None if goal is not None else 0
    if (wanted is not None and wanted < 0) or most_control < 0:
        raise InputError("a number of control points below 0 is not possible", "give 0 or more")
    if (dem is None) == (ground is None):
        raise InputError("the height of the ground is given by a DEM or by a level", "give one: --dem or --ground")
    chosen = camera_of_plan(os.fspath(camera), self_calibration != "none")
    where = read_area(os.fspath(area), crs or _crs_of(dem))
    if piles is not None:
        where = with_piles(where, os.fspath(piles))
    height = gsd * chosen.interior["focal_length_mm"].value / chosen.pixel_mm
    reach = 3.0 * height * max(chosen.half_format_mm) / chosen.interior["focal_length_mm"].value
    terrain = _terrain(dem, ground, where, reach)
    made = make_plan(
        where, terrain, chosen, options, goal, given, wanted, most_control, *(() if progress is None else (progress,))
    )
    return FlightPlan(made, Head(project_of(project), made.area.crs or "local"), request)


def _request(given: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments as JSON knows them, files by their whole path, so that a plan can be made again from elsewhere."""
    from aerotri.simulation.presets import PRESETS

    kept = {name: value for name, value in given.items() if name != "progress"}
    for name in FILES:
        if isinstance(kept[name], str | os.PathLike):
            text = os.fspath(kept[name])
            is_file = text not in ("auto", *PRESETS) and _is_there(text)
            kept[name] = str(real_path(Path(text))) if is_file else text
    return kept


def _is_there(text: str) -> bool:
    """Whether a text names a file; a polygon as text may be longer than names can be."""
    try:
        return Path(text).exists()
    except (OSError, ValueError):
        return False


def _crs_of(dem: FilePath | None) -> str | None:
    from aerotri.planning.ground import crs_of_dem

    return None if dem is None else crs_of_dem(Path(dem))


def _terrain(dem: FilePath | None, ground: float | None, where: Any, reach: float) -> Ground:
    from aerotri.planning.ground import ground_of_dem, level_ground

    return ground_of_dem(Path(dem), where, reach) if dem is not None else level_ground(float(ground or 0.0))
