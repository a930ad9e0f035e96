"""Cameras of a DBAT script: values, and which of them the bundle estimates.

DBAT counts pixels from 1 at their centres and puts the principal point into the same system, in mm from the upper left;
half a pixel is therefore taken off (see `dbat`). Its lens correction is added to what was measured, as Brown's
parameters here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from aerotri.conventions import InputError
from aerotri.formats.text.tables import SMALLEST_POSITIVE
from aerotri.formats.text.xml_text import child_text, numbers, text_of
from aerotri.observations import Camera, Prior

SAME_PIXEL = 1e-6
"""Relative difference of pixel width and height that counts as none."""
LENS = ("K1", "K2", "K3", "P1", "P2")
UNIT_MM = {"mm": 1.0}
"""Millimetres of the units a DBAT script may name: all its cameras are in mm."""
GROUPS = {
    "all": ("cc", "px", "py", *LENS, "aspect", "skew"), "cc": ("cc",), "pp": ("px", "py"), "K": LENS[:3], "P": LENS[3:],
}  # fmt: skip
"""Parameters that an element of a DBAT script stands for."""
ASPECT, SKEW = "aspect", "skew"


@dataclass(frozen=True)
class DbatCamera:
    """A camera element: `values` of cc, px, py (mm, DBAT's pixel system) and of K1 … P2, by name."""

    number: str
    name: str
    size_px: tuple[int, int]
    pixel_mm: float
    values: dict[str, float]

    def camera(self, estimated: frozenset[str]) -> Camera:
        """The record; what is estimated is free, the rest is held."""
        x0 = self.values["px"] - (0.5 + self.size_px[0] / 2.0) * self.pixel_mm
        y0 = (0.5 + self.size_px[1] / 2.0) * self.pixel_mm - self.values["py"]
        interior = {"focal_length_mm": (self.values["cc"], "cc"), "x0_mm": (x0, "px"), "y0_mm": (y0, "py")}
        lens = {name: Prior(self.values[name], fixed=name not in estimated) for name in LENS}
        # a lens without errors that is not estimated either is no lens: it stays free for other settings
        acts = any(prior.value or not prior.fixed for prior in lens.values())
        return Camera(
            name=self.name,
            model="frame",
            size_px=self.size_px,
            pixel_um=self.pixel_mm * 1e3,
            interior={name: Prior(value, fixed=key not in estimated) for name, (value, key) in interior.items()},
            brown=lens if acts else {},
        )


def read_camera(element: Element, default_values: bool, path: Path) -> DbatCamera:
    """A camera element of the script or of a camera file.

    Parameters
    ----------
    default_values : whether the script starts from DBAT's defaults (nominal focal length, centre of the sensor, no
        lens errors) instead of the values given.
    path : the file, for errors.

    Raises
    ------
    InputError
        For what is missing or cannot be expressed: pixels that are not square, skew, a forward lens.
    """
    name = child_text(element, "name", path)
    unit = child_text(element, "unit", path, "mm")
    if unit not in UNIT_MM:
        raise InputError(f"camera '{name}' is measured in '{unit}'", "give it in mm", path)
    columns, rows = numbers(child_text(element, "image", path), 2, "image", path)
    size_px = (round(columns), round(rows))
    if min(size_px) < 1:
        raise InputError(f"camera '{name}' has an image of {size_px[0]} × {size_px[1]} pixels", "give its size", path)
    pixel_mm = _pixel_mm(element, size_px, name, path)
    model = numbers(child_text(element, "model", path, "1"), 1, "model", path)[0]
    values = _values(element, size_px, pixel_mm, default_values, path)
    if model <= 0 and any(values[key] for key in LENS):
        raise InputError(
            f"camera '{name}' has a forward lens (model {model:g})",
            "give it in DBAT's backward models 1 to 5, whose correction is added to the measurement",
            path,
        )
    return DbatCamera(child_text(element, "id", path, ""), name, size_px, pixel_mm, values)


def _pixel_mm(element: Element, size_px: tuple[int, int], name: str, path: Path) -> float:
    sensor = [part.strip() for part in child_text(element, "sensor", path).split(",")]
    if len(sensor) != 2:
        raise InputError(f"sensor = '{','.join(sensor)}'", "give width,height in mm, or auto,height", path)
    aspect = numbers(child_text(element, "aspect", path, "1"), 1, "aspect", path)[0]
    skew = numbers(child_text(element, "skew", path, "0"), 1, "skew", path)[0]
    height = numbers(sensor[-1], 1, "sensor", path)[0] / size_px[1]
    width = height if sensor[0] == "auto" else numbers(sensor[0], 1, "sensor", path)[0] / size_px[0]
    if aspect != 1.0 or skew != 0.0 or abs(width - height) > SAME_PIXEL * height:
        raise InputError(
            f"camera '{name}' has pixels that are not square (aspect {aspect:g}, skew {skew:g}, "
            f"{width * 1e3:.6g} × {height * 1e3:.6g} µm)",
            "give it with square pixels; affinity and shear are the additional parameters brown:b1+b2",
            path,
        )
    if height < SMALLEST_POSITIVE:
        raise InputError(f"camera '{name}' has a sensor of no size", "give width,height in mm", path)
    return height


def _values(
    element: Element, size_px: tuple[int, int], pixel_mm: float, default_values: bool, path: Path
) -> dict[str, float]:
    """cc, px, py, K1 … P2. 'focal' and 'default' are DBAT's own words."""
    cc = "focal" if default_values else child_text(element, "cc", path, "focal")
    if cc == "focal":
        cc = child_text(element, "focal", path)
    pp = "default" if default_values else child_text(element, "pp", path, "default")
    middle = [size_px[0] * pixel_mm / 2.0, size_px[1] * pixel_mm / 2.0]
    point = middle if pp == "default" else numbers(pp, 2, "pp", path)
    values = {"cc": numbers(cc, 1, "cc", path)[0], "px": point[0], "py": point[1]}
    if values["cc"] < SMALLEST_POSITIVE:
        raise InputError(f"cc = {cc} is no principal distance", "give it in mm, greater than 0", path)
    for letter, names in (("K", LENS[:3]), ("P", LENS[3:])):
        text = "" if default_values else child_text(element, letter, path, "")
        given = numbers(text, None, letter, path) if text else []
        if any(given[len(names) :]):
            raise InputError(f"{letter} has more than {len(names)} coefficients", "leave out the others", path)
        values |= dict(zip(names, [*given, 0.0, 0.0, 0.0][: len(names)], strict=True))
    return values


def estimated_elements(element: Element | None, path: Path) -> frozenset[str]:
    """Which of cc, px, py, K1 … P2, aspect an ``<io>`` of set_bundle_estimate_params lets the bundle estimate.

    Raises
    ------
    InputError
        For an unknown element, and for skew, which has no counterpart here.
    """
    if element is None:
        return frozenset()
    entries = [(child.tag, text_of(child)) for child in element if child.tag != "c"]
    chosen: set[str] = set()
    for tag, text in entries or [("all", text_of(element))]:
        if text not in ("true", "false"):
            raise InputError(f"<io><{tag}> is '{text}'", "it is true or false", path)
        names = GROUPS.get(tag, (tag,))
        if not set(names) <= set(GROUPS["all"]):
            raise InputError(f"<io> has an unknown element <{tag}>", f"known are {', '.join(GROUPS['all'])}", path)
        chosen = chosen | set(names) if text == "true" else chosen - set(names)
    if SKEW in chosen:
        raise InputError("the script estimates skew", "set it to false: <skew>false</skew>", path)
    return frozenset(chosen)
