"""Adjusted cameras in the parameters of other programs, as people type them in there or compare them.

[L] Metashape: see `metashape_camera`. [L] Pix4D, "How are the internal and external camera parameters defined": with
r² = x² + y² of the ideal position for c = 1, x' = x(1 + R1r² + R2r⁴ + R3r⁶) + 2T1xy + T2(r² + 2x²), y' = y(…) + 2T2xy +
T1(r² + 2y²), in pixels F·x' + cx, F·y' + cy; y down, as in its files of calibrated cameras. That is Metashape's lens
without k4, b1, b2, with T1 = P2 and T2 = P1. Pix4D's fisheye is a polynomial of another kind.
"""

from __future__ import annotations

from dataclasses import dataclass

from aerotri.formats.assembly.oriented import oriented_from_adjusted
from aerotri.formats.foreign.lens_fit import fitted_camera
from aerotri.formats.foreign.metashape_camera import RADIAL, calibration_of
from aerotri.formats.foreign.metashape_camera import expressible as as_metashape
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock

METASHAPE, PIX4D = "Metashape", "Pix4D"
PIX4D_LENS = ("k1", "k2", "k3", "p1", "p2")
"""Items of our lens that Pix4D has words for."""
NO_FISHEYE = "Pix4D describes a fisheye by another polynomial, so its parameters cannot be given"
IN_PIXELS = ("f", "cx", "cy", "b1", "b2")


@dataclass(frozen=True)
class CameraElsewhere:
    """A camera in the words of another program.

    Parameters
    ----------
    camera : its name; where groups of photographs have parameters of their own, with that of the group.
    program : its name.
    values : name, value and unit of every parameter; () where the program cannot describe the camera.
    said : what is only near, or why there are no values, in sentences.
    """

    camera: str
    program: str
    values: tuple[tuple[str, float, str], ...]
    said: tuple[str, ...] = ()


def cameras_elsewhere(adjusted: AdjustedBlock) -> tuple[CameraElsewhere, ...]:
    """Every camera with photographs at its adjusted values, in the words of Metashape and of Pix4D."""
    oriented = oriented_from_adjusted(adjusted)
    found: list[CameraElsewhere] = []
    for k, camera in enumerate(oriented.block.cameras):
        errors = oriented.format_errors[k] if oriented.format_errors else None
        near, said = as_metashape(camera, errors)
        units = {name: "px" if name in IN_PIXELS else "" for name in calibration_of(near)}
        values = tuple((name, value, units[name]) for name, value in calibration_of(near).items())
        found.append(CameraElsewhere(camera.name, METASHAPE, values, said))
        if camera.is_fisheye:
            found.append(CameraElsewhere(camera.name, PIX4D, (), (f"camera '{camera.name}': {NO_FISHEYE}",)))
            continue
        bent = any(one.value for one in camera.brown.values()) or (errors is not None and bool(errors.any()))
        beyond = any(one.value for name, one in camera.lens.items() if name not in PIX4D_LENS)
        near, said = fitted_camera(camera, PIX4D_LENS, errors, PIX4D) if bent or beyond else (camera, ())
        found.append(CameraElsewhere(camera.name, PIX4D, _pix4d(near), said))
    return tuple(found)


def _pix4d(camera: Camera) -> tuple[tuple[str, float, str], ...]:
    """Focal length and principal point, this from the upper left corner, in pixels and mm; R1 to R3, T1, T2."""
    own, (columns, rows) = calibration_of(camera), camera.size_px
    place = {"focal length": own["f"], "principal point x": columns / 2 + own["cx"],
             "principal point y": rows / 2 + own["cy"]}  # fmt: skip
    lengths = [(name, value * factor, unit) for name, value in place.items()
               for factor, unit in ((1.0, "px"), (camera.pixel_mm, "mm"))]  # fmt: skip
    radial = [(f"R{k}", own[name], "") for k, name in enumerate(RADIAL[:3], start=1)]
    return (*lengths, *radial, ("T1", own["p2"], ""), ("T2", own["p1"], ""))
