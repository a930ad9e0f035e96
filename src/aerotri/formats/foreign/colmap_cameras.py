"""Cameras of COLMAP: its models in our terms, and ours in its.

COLMAP's lenses are the forward lens of `additional_parameters.lens` in a frame whose y points down, so p1, sy and b2
change sign. k4, k5, k6 of its FULL_OPENCV are our q1, q2, q3. Two focal lengths are c = fy with the affinity b1 = fy/fx
− 1 of Brown's family, which is exact, since it acts on the measured x alone.

Models of other formulas (FOV, EUCM, division models, RAD_TAN_THIN_PRISM_FISHEYE) are read by a fit whose residual is
stated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, mm_from_px, px_from_mm
from aerotri.formats.foreign.lens_fit import FittedLens, fitted_camera, fitted_lens, format_grid_px, nearest_lens
from aerotri.formats.text.tables import LARGEST_NUMBER
from aerotri.functional_model.additional_parameters import lens
from aerotri.observations import Camera, Prior


@dataclass(frozen=True)
class ColmapModel:
    """lens : items in COLMAP's order. focal_lengths : 1 or 2. fisheye : its projection."""

    lens: tuple[str, ...] = ()
    focal_lengths: int = 1
    fisheye: bool = False

    @property
    def projection(self) -> str:
        return "fisheye" if self.fisheye else "perspective"


# of a denominator a fit takes the first term only: with more of them it may come near to zero inside the format
RATIONAL = ("k1", "k2", "p1", "p2", "k3", "q1", "q2", "q3")
THIN_PRISM = ("k1", "k2", "p1", "p2", "k3", "k4", "sx", "sy")
MODELS: Mapping[str, ColmapModel] = {
    "SIMPLE_PINHOLE": ColmapModel(),
    "PINHOLE": ColmapModel(focal_lengths=2),
    "SIMPLE_RADIAL": ColmapModel(("k1",)),
    "RADIAL": ColmapModel(("k1", "k2")),
    "OPENCV": ColmapModel(("k1", "k2", "p1", "p2"), 2),
    "FULL_OPENCV": ColmapModel(RATIONAL, 2),
    "SIMPLE_RADIAL_FISHEYE": ColmapModel(("k1",), 1, True),
    "RADIAL_FISHEYE": ColmapModel(("k1", "k2"), 1, True),
    "OPENCV_FISHEYE": ColmapModel(("k1", "k2", "k3", "k4"), 2, True),
    "THIN_PRISM_FISHEYE": ColmapModel(THIN_PRISM, 2, True),
    "SIMPLE_FISHEYE": ColmapModel((), 1, True),
    "FISHEYE": ColmapModel((), 2, True),
}
"""Models of the same formulas; of those that hold a camera the first is written, which old versions know."""
FITTED: Mapping[str, int] = {
    "FOV": 2, "SIMPLE_DIVISION": 1, "DIVISION": 2, "EUCM": 2, "RAD_TAN_THIN_PRISM_FISHEYE": 2,
}  # fmt: skip
"""Models of other formulas, and their focal lengths."""
FITTED_LENS = {False: ("k1", "k2", "p1", "p2", "k3", "k4", "q1", "q2"), True: THIN_PRISM}
"""Items that a fit takes, of a perspective camera and of a fisheye."""
WIDEST = np.tan(np.radians(80.0))
"""Tangent beyond which a fit takes the fisheye alone: a polynomial of the tangent is of no use there [C]."""
SIGN = {"p1": -1.0, "sy": -1.0, "b2": -1.0}
"""Parameters that change their sign with y."""
RATIONAL_ONLY = ("q1", "q2", "q3")
SMALLEST_FOCAL_PX, MOST_PIXELS, LARGEST_RATIO = 1e-3, 10_000_000, 100.0
"""Least focal length, largest format, both pixels, and largest ratio of two focal lengths; chosen [C]: beyond any
camera, so that only damaged files are refused."""


def read_camera(camera: Any, pixel_um: float, folder: Path) -> tuple[Camera, tuple[str, ...]]:
    """A camera of pycolmap, and what is to be said of it.

    Focal lengths and lens are free, the principal point is held. Denominators of the rational model and fitted lenses
    are held at their values: nearly alike terms that a new adjustment would hardly tell apart.

    Raises
    ------
    InputError
        For values that no camera has, and models without focal length.
    """
    name, values = camera.model.name, list(camera.params)
    if name not in MODELS and name not in FITTED:
        known = ", ".join((*MODELS, *FITTED))
        raise InputError(f"camera {camera.camera_id} is of model {name}", f"known are {known}", folder)
    count = MODELS[name].focal_lengths if name in MODELS else FITTED[name]
    focal, (cx, cy, *rest) = (values[0], values[count - 1]), values[count:]
    possible = bool((np.abs(values) <= LARGEST_NUMBER).all())
    possible = possible and min(focal) >= SMALLEST_FOCAL_PX and max(focal) < LARGEST_RATIO * min(focal)
    if not possible or not 0 < min(camera.width, camera.height) <= max(camera.width, camera.height) <= MOST_PIXELS:
        raise InputError(f"camera {camera.camera_id} has no valid parameters", "calibrate it first", folder)
    size = (int(camera.width), int(camera.height))
    x0, y0 = mm_from_px(np.array([[cx, cy]]), size, pixel_um * 1e-3)[0]
    read = Camera(
        name=str(camera.camera_id),
        model="frame",
        size_px=size,
        pixel_um=pixel_um,
        interior={
            "focal_length_mm": Prior(float(focal[1] * pixel_um * 1e-3)),
            "x0_mm": Prior(float(x0), fixed=True),
            "y0_mm": Prior(float(y0), fixed=True),
        },
        brown={} if focal[0] == focal[1] else {"b1": Prior(float(focal[1] / focal[0] - 1.0))},
    )
    if name in FITTED:
        return _with_fit(read, camera, (cx, cy), focal, folder)
    model = MODELS[name]
    found = {key: SIGN.get(key, 1.0) * float(value) for key, value in zip(model.lens, rest, strict=True)}
    rational = any(found.get(key) for key in RATIONAL_ONLY)
    priors = {
        key: Prior(value, fixed=key in RATIONAL_ONLY)
        for key, value in found.items()
        if rational or key not in RATIONAL_ONLY
    }
    said = (f"camera {read.name}: the denominator k4, k5, k6 of its lens is held at its values",) if rational else ()
    return replace(read, lens=priors, projection=model.projection), said


def _with_fit(
    read: Camera, camera: Any, centre: tuple[float, float], focal: tuple[float, float], folder: Path
) -> tuple[Camera, tuple[str, ...]]:
    """The camera with the nearest of our lenses, held."""
    px = format_grid_px(read.size_px)
    tangent = camera.cam_from_img(px)
    there = np.isfinite(tangent).all(axis=1)
    if there.any():
        back = camera.img_from_cam(np.column_stack([tangent[there], np.ones(int(there.sum()))]))
        there[there] &= np.hypot(*(back - px[there]).T) < 1e-6
    if not there.all():
        raise InputError(
            f"camera {read.name} of model {camera.model.name} has no direction for parts of its format",
            "estimate it as OPENCV_FISHEYE",
            folder,
        )
    flip = np.array([1.0, -1.0])
    bent, tangent = (px - np.array(centre)) / np.array(focal) * flip, tangent * flip
    wide = bool(np.hypot(*tangent.T).max() > WIDEST)
    fits = [_fit(tangent, bent, fisheye, focal[1]) for fisheye in ((True,) if wide else (False, True))]
    best = min(fits, key=lambda fit: fit.rms_px)
    fisheye = bool(best.parameters[lens.FISHEYE])
    said = (
        f"camera {read.name} of model {camera.model.name} is read as a {'fisheye' if fisheye else 'perspective'} lens "
        f"fitted to it and held; differences: {best.text}"
    )
    priors = {key: Prior(value, fixed=True) for key, value in best.values(FITTED_LENS[fisheye]).items() if value}
    return replace(read, lens=priors, projection="fisheye" if fisheye else "perspective"), (said,)


def _fit(tangent: np.ndarray, bent: np.ndarray, fisheye: bool, focal_px: float) -> FittedLens:
    ideal = lens.distort(tangent[:, 0], tangent[:, 1], lens.vector({}, fisheye))
    return fitted_lens(ideal, bent, FITTED_LENS[fisheye], fisheye, focal_px)


def colmap_camera(camera: Camera, first: str = "") -> tuple[str, list[float]]:
    """COLMAP's model and parameters (pixels) of a camera; of Brown's family only b1 counts.

    Parameters
    ----------
    first : model to be taken where it can hold the camera.

    Returns
    -------
    model : else the smallest that has all lens parameters the camera names.
    values : in COLMAP's order.

    Raises
    ------
    InputError
        When no model has them; see `expressible`.
    """
    fy = camera.focal_length_mm / camera.pixel_mm
    fx = fy * (1.0 + value(camera, "b1")) / (1.0 + (camera.brown["b1"].value if "b1" in camera.brown else 0.0))
    cx, cy = px_from_mm(np.array([camera.principal_point_mm]), camera.size_px, camera.pixel_mm)[0].tolist()
    wanted = _holding(camera)
    if not wanted or value(camera, "b2"):
        raise InputError(f"COLMAP has no model for the lens of camera '{camera.name}'", "write it with the fitted lens")
    wanted = sorted(wanted, key=lambda name: name != first)
    name = next(name for name in wanted if MODELS[name].focal_lengths == 2 or fx == fy)
    lens_values = [SIGN.get(key, 1.0) * value(camera, key) for key in MODELS[name].lens]
    return name, [*([fx, fy] if MODELS[name].focal_lengths == 2 else [fy]), cx, cy, *lens_values]


def expressible(camera: Camera) -> tuple[Camera, tuple[str, ...]]:
    """The camera with a lens that COLMAP has words for, and in words what was fitted."""
    if _holding(camera):
        return camera, ()
    return with_nearest(camera, THIN_PRISM if camera.is_fisheye else RATIONAL[:6], "COLMAP")


def whole_camera(camera: Camera, errors: np.ndarray | None) -> tuple[Camera, tuple[str, ...]]:
    """The camera for image points as measured: where COLMAP has no words for it, all that it does is fitted.

    Parameters
    ----------
    errors : of additional parameters beside the lens, see `lens_fit.nearest_of_all`.
    """
    other = any(prior.value for name, prior in camera.brown.items() if name != "b1")
    if errors is None and not other and not value(camera, "b2") and _holding(camera):
        return camera, ()
    items = THIN_PRISM if camera.is_fisheye else RATIONAL[:6]
    return fitted_camera(camera, (*items, "b1"), errors, "COLMAP")


def with_nearest(camera: Camera, names: tuple[str, ...], program: str) -> tuple[Camera, tuple[str, ...]]:
    """The camera with the nearest lens of these items, its affinity kept, and in words what that leaves."""
    best = nearest_lens(camera, names)
    kept = {key: prior for key, prior in camera.lens.items() if key in ("b1", "b2")}
    fitted = {key: Prior(value, fixed=True) for key, value in best.values(names).items()}
    said = f"camera '{camera.name}': {program} has no words for its lens; the nearest lens is written, {best.text}"
    return replace(camera, lens={**fitted, **kept}), (said,)


def value(camera: Camera, name: str) -> float:
    """The lens parameter of a camera, 0 where it has none."""
    return camera.lens[name].value if name in camera.lens else 0.0


def _holding(camera: Camera) -> list[str]:
    """Models that have what the lens names; what is held at zero does not count."""
    named = {key for key, prior in camera.lens.items() if key not in ("b1", "b2") and (prior.value or not prior.fixed)}
    return [key for key, model in MODELS.items() if model.fisheye == camera.is_fisheye and named <= set(model.lens)]
