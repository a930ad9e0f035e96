"""A block: what was measured, as frozen records of arrays, never an object per point.

Units inside the records: image coordinates mm from the image centre (x right, y up), object coordinates metres, angles
radians. Names are arrays of str; everything else refers to them by index.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from aerotri.observations.prior import Prior
from aerotri.observations.project import Project
from aerotri.observations.rigs import Rig
from aerotri.observations.rolling_shutter import RollingShutter
from aerotri.observations.settings import Settings

INTERIOR_ELEMENTS = ("focal_length_mm", "x0_mm", "y0_mm")
BROWN_NAMES = ("K1", "K2", "K3", "P1", "P2", "b1", "b2")
LENS_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "q1", "q2", "q3", "sx", "sy", "b1", "b2")
PROJECTIONS = ("perspective", "fisheye")
INTERIOR_ORIENTATIONS = ("similarity", "affine", "projective")
EDIT_ACTIONS = ("off", "check", "control")
CONSTRAINT_KINDS = ("vertical", "horizontal", "height_difference", "distance", "plane", "line")


@dataclass(frozen=True)
class Camera:
    """A camera: format, interior orientation and lens.

    Parameters
    ----------
    model : 'frame', 'ultracam_d' or 'dmc'.
    size_px : columns, rows.
    pixel_um : size of a pixel, µm.
    interior : a `Prior` for each of focal_length_mm, x0_mm, y0_mm (principal distance and principal point, mm).
    brown : `Prior` of Brown's parameters by name (`BROWN_NAMES`, units mm^-k); a function of the measured position.
    lens : `Prior` of the forward lens parameters by name (`LENS_NAMES`, dimensionless); a function of the ideal
        direction, as OpenCV, COLMAP, Bundler and Metashape have it.
    parameters : `Prior` of parameters of the linear families by name ('bluh.9', 'legendre.bx2y0').
    projection : one of `PROJECTIONS`: an ideal ray at the angle θ to the axis lies c·tan θ (perspective) or c·θ
        (fisheye, equidistant) from the principal point.
    flight_axis : image axis along the flight ('+x', '-x', '+y', '-y') or None when not stated.
    fiducials : calibrated positions (x, y) in mm of the fiducial marks of a film camera, by name.
    interior_orientation : one of `INTERIOR_ORIENTATIONS`, how scans of a film camera are brought to the marks.
    rolling_shutter : None where all rows are exposed at once.
    """

    name: str
    model: str
    size_px: tuple[int, int]
    pixel_um: float
    interior: Mapping[str, Prior]
    brown: Mapping[str, Prior] = field(default_factory=dict)
    lens: Mapping[str, Prior] = field(default_factory=dict)
    parameters: Mapping[str, Prior] = field(default_factory=dict)
    projection: str = "perspective"
    flight_axis: str | None = None
    fiducials: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    interior_orientation: str | None = None
    rolling_shutter: RollingShutter | None = None

    @property
    def pixel_mm(self) -> float:
        return self.pixel_um * 1e-3

    @property
    def focal_length_mm(self) -> float:
        return self.interior["focal_length_mm"].value

    @property
    def principal_point_mm(self) -> tuple[float, float]:
        return self.interior["x0_mm"].value, self.interior["y0_mm"].value

    @property
    def is_fisheye(self) -> bool:
        return self.projection == "fisheye"

    @property
    def half_format_mm(self) -> tuple[float, float]:
        """Half width and half height of the format, mm."""
        return self.size_px[0] * self.pixel_mm / 2.0, self.size_px[1] * self.pixel_mm / 2.0

    @property
    def r_max_mm(self) -> float:
        """Distance of the corners from the image centre, mm."""
        return float(np.hypot(*self.half_format_mm))


@dataclass(frozen=True, eq=False)
class Images:
    """The photographs, n of them.

    Parameters
    ----------
    names : (n,) str.
    camera : (n,) index into the block's cameras.
    strip : (n,) str, '' where not named.
    centre : (n, 3) m, start values of the projection centres, NaN where to be computed.
    angles : (n, 3) rad, start values of ω, φ, κ, NaN where to be computed.
    columns : grouping columns by name, each (n,) str.
    """

    names: np.ndarray
    camera: np.ndarray
    strip: np.ndarray
    centre: np.ndarray
    angles: np.ndarray
    columns: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.names)

    def take(self, rows: np.ndarray) -> Images:
        """Those of some rows."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        return Images(
            self.names[rows], self.camera[rows], self.strip[rows], self.centre[rows], self.angles[rows], columns
        )


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """The rays, m of them, in the order of the input.

    Parameters
    ----------
    image, point : (m,) index into images and into the block's point names.
    xy : (m, 2) mm.
    sigma : (m, 2) mm, a-priori standard deviations.
    """

    image: np.ndarray
    point: np.ndarray
    xy: np.ndarray
    sigma: np.ndarray

    def __len__(self) -> int:
        return len(self.image)


@dataclass(frozen=True, eq=False)
class Control:
    """Control and check points, k of them.

    Parameters
    ----------
    point : (k,) index into the block's point names.
    xyz : (k, 3) m, NaN where a coordinate is unknown (height-only, plan-only).
    sigma : (k, 3) m, NaN where the coordinate is.
    is_check : (k,) bool: a check point is never in the equations.
    """

    point: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray
    is_check: np.ndarray

    def __len__(self) -> int:
        return len(self.point)

    @classmethod
    def empty(cls) -> Control:
        return cls(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool))


@dataclass(frozen=True, eq=False)
class GnssIns:
    """Observed antenna positions and attitudes, g of them.

    Parameters
    ----------
    image : (g,) index.
    xyz, sigma : (g, 3) m; NaN where not observed.
    angles, angles_sigma : (g, 3) rad; NaN where not observed.
    time : (g,) s; NaN where not given.
    """

    image: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray
    angles: np.ndarray
    angles_sigma: np.ndarray
    time: np.ndarray

    def __len__(self) -> int:
        return len(self.image)


@dataclass(frozen=True, eq=False)
class Fiducials:
    """Measured fiducial marks of scanned photographs, f of them.

    Parameters
    ----------
    image : (f,) index.
    name : (f,) str, marks of the photograph's camera.
    column_row : (f, 2) px in the scan, (0, 0) the upper left corner of the upper left pixel.
    """

    image: np.ndarray
    name: np.ndarray
    column_row: np.ndarray

    def __len__(self) -> int:
        return len(self.image)


@dataclass(frozen=True, eq=False)
class Edits:
    """The operator's decisions, e of them, kept apart from the measurements.

    `off` with an image takes one ray out of the adjustment; `off` without an image takes out the coordinates of a
    control or check point (its rays stay), or every ray of a point that is neither. `check` and `control`, always
    without an image, make a control or check point the one or the other, whatever its role in the table.

    Parameters
    ----------
    image : (e,) index, −1 where no image is named.
    point : (e,) index into the block's point names.
    action : (e,) str, of `EDIT_ACTIONS`.
    reason : (e,) str, '' where none is given.
    """

    image: np.ndarray
    point: np.ndarray
    action: np.ndarray
    reason: np.ndarray

    def __len__(self) -> int:
        return len(self.image)


@dataclass(frozen=True, eq=False)
class Constraints:
    """Conditions between object points, k of them.

    Parameters
    ----------
    kind : (k,) str, of `CONSTRAINT_KINDS`: vertical (same X and Y), horizontal (same Z), height_difference (Z of the
        second less Z of the first point), distance, plane, line (the points lie on one).
    points : for each its points, an index array into the block's point names, in the order given.
    value : (k,) m, NaN for kinds that have none.
    sigma : (k,) m.
    axes : (k, 3, 3) east, north and up at the place, as columns, of a block brought into the local frame of its CRS;
        None where Z is up everywhere.
    """

    kind: np.ndarray
    points: tuple[np.ndarray, ...]
    value: np.ndarray
    sigma: np.ndarray
    axes: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.kind)


@dataclass(frozen=True, eq=False, repr=False)
class Block:
    """Everything that was measured of one block, with the settings of its adjustment.

    Parameters
    ----------
    name : the block's name.
    crs : 'local' or 'EPSG:…'.
    rotation : order of the angles, see `conventions`.
    cameras : the cameras; images refer to them by index.
    points : (N,) str, the names of all points measured or given.
    gnss_ins : None when nothing was observed.
    edits, fiducials, constraints : None when there are none.
    rigs : cameras on one frame; the column `station` of the images says which photographs belong to one exposure.
    interior_fits : of scanned photographs by index, the `functional_model.interior.FiducialFit` that brought their
        image points from pixels of the scan to the mm that `image_points` holds.
    project : client, operator and the like.
    """

    name: str
    cameras: tuple[Camera, ...]
    images: Images
    points: np.ndarray
    image_points: ImagePoints
    control: Control = field(default_factory=Control.empty)
    gnss_ins: GnssIns | None = None
    settings: Settings = field(default_factory=Settings)
    crs: str = "local"
    rotation: str = "omega-phi-kappa"
    edits: Edits | None = None
    fiducials: Fiducials | None = None
    constraints: Constraints | None = None
    interior_fits: Mapping[int, Any] = field(default_factory=dict)
    rigs: tuple[Rig, ...] = ()
    project: Project = field(default_factory=Project)

    @property
    def counts(self) -> dict[str, int]:
        """How many there are of what a block holds."""
        is_check = self.control.is_check
        return {
            "photographs": len(self.images),
            "image points": len(self.image_points),
            "object points": len(self.points),
            "control points": int((~is_check).sum()),
            "check points": int(is_check.sum()),
            "observed positions or attitudes": 0 if self.gnss_ins is None else len(self.gnss_ins),
        }

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {what}" for what, count in self.counts.items() if count)
        return f"<aerotri.Block {self.name!r}: {counts}>"

    def _repr_html_(self) -> str:
        """What the block holds, as a notebook shows it."""
        cameras = ", ".join(
            f"{c.name} ({c.size_px[0]} × {c.size_px[1]}, {c.focal_length_mm:g} mm)" for c in self.cameras
        )
        facts = {**self.counts, "cameras": cameras, "coordinate system": self.crs}
        rows = "".join(f"<tr><th>{what}</th><td>{escape(str(value))}</td></tr>" for what, value in facts.items())
        return f"<table><caption>{escape(str(self.name))}</caption>{rows}</table>"
