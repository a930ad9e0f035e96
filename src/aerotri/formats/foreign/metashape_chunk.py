"""What a chunk of Metashape says: sensors, cameras, markers, accuracies, its coordinate system and transformation.

The frame of a camera is x right, y down, z forwards, its transform leads to the chunk; the chunk's transform X = t +
s·R·x leads to earth-centred coordinates, or to those of a local system.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.foreign.metashape_camera import NOT_EXPRESSED, PROJECTIONS, RADIAL
from aerotri.formats.foreign.metashape_files import REMEDY
from aerotri.formats.foreign.reconstruction import rotation_matrix
from aerotri.formats.text.sigmas import REMEDY as REMEDY_OF_SIGMA
from aerotri.formats.text.sigmas import impossible_sigmas, why_impossible
from aerotri.formats.text.tables import (
    CONTROL_CHARACTERS,
    LARGEST_FORMAT_PX,
    LARGEST_NUMBER,
    LONGEST_NAME,
    SMALLEST_POSITIVE,
)
from aerotri.formats.text.text_lines import is_number
from aerotri.formats.text.xml_text import text_of
from aerotri.observations import Camera, Prior

TRUE = ("true", "1", "yes")
ACCURACIES = {"tiepoints": 1.0, "projections": 0.1, "markers": 0.005, "cameras": 10.0}
"""Settings and their values in a new project: pixels, pixels, m, m."""
SYSTEMS = ("GEOGCS[", "PROJCS[", "GEOCCS[", "COMPD_CS[", "LOCAL_CS[", "VERT_CS[")
AUTHORITY = re.compile(r'AUTHORITY\["EPSG","(\d{1,6})"\]\]\s*$')


def number(text: str | None, what: str, path: Path) -> float:
    """A finite number.

    Raises
    ------
    InputError
    """
    word = (text or "").strip()
    if not is_number(word) or not abs(float(word)) <= LARGEST_NUMBER:
        raise InputError(f"{what[:80]} = '{word[:40]}' is not a number", REMEDY, path)
    return float(word)


def numbers(element: Element | None, count: int, what: str, path: Path) -> np.ndarray:
    """So many numbers, separated by blanks.

    Raises
    ------
    InputError
    """
    words = text_of(element).split()
    if len(words) != count:
        raise InputError(f"{what[:80]} does not have {count} numbers", REMEDY, path)
    return np.array([number(word, what, path) for word in words])


def is_on(element: Element, key: str, default: str = "true") -> bool:
    """Whether an attribute says yes."""
    return element.get(key, default).strip().lower() in TRUE


def names_of(elements: Iterable[Element], what: str, path: Path) -> dict[str, str]:
    """Labels by id, of which none may be there twice or could not stand in a table.

    Raises
    ------
    InputError
    """
    found: dict[str, str] = {}
    for element in elements:
        key, label = element.get("id", ""), (element.get("label") or f"{what} {element.get('id', '')}").strip()
        if not key or key in found:
            raise InputError(f"two of its {what}s have the id '{key[:40]}'", REMEDY, path)
        if not label or len(label) > LONGEST_NAME or re.search(CONTROL_CHARACTERS, label):
            raise InputError(f"{label[:60]!r} cannot be the name of a {what}", f"rename the {what}", path)
        found[key] = label
    twice = [label for label, count in Counter(found.values()).items() if count > 1]
    if twice:
        raise InputError(f"two of its {what}s are called '{twice[0][:60]}'", f"rename one {what}", path)
    return found


@dataclass(frozen=True)
class Sensor:
    """A sensor.

    Parameters
    ----------
    camera : of this program. master : id of the sensor that leads its rig, '' for none.
    """

    camera: Camera
    master: str


def sensors_of(chunk: Element, used: set[str], pixel_um: float | None, path: Path) -> dict[str, Sensor]:
    """The sensors of photographs, by id.

    Parameters
    ----------
    used : ids of sensors that have photographs. pixel_um : size of a pixel; as the file says where None.

    Raises
    ------
    InputError
        For a sensor without calibration, of another projection or with old terms.
    """
    found = [sensor for sensor in chunk.findall("sensors/sensor") if sensor.get("id") in used]
    labels = {sensor.get("id", ""): (sensor.get("label") or "camera").strip() or "camera" for sensor in found}
    several = {label for label, count in Counter(labels.values()).items() if count > 1}
    out: dict[str, Sensor] = {}
    for sensor in found:
        key = sensor.get("id", "")
        name = f"{labels[key]} {key}" if labels[key] in several else labels[key]
        master = sensor.get("master_id", "")
        out[key] = Sensor(_camera(sensor, name, pixel_um, path), master if master != key else "")
    missing = used - set(out)
    if missing:
        raise InputError(f"has photographs of a sensor '{min(missing)[:40]}' that is not described", REMEDY, path)
    return out


def _camera(sensor: Element, name: str, pixel_um: float | None, path: Path) -> Camera:
    kind = sensor.get("type", "frame")
    if kind not in PROJECTIONS:
        raise InputError(f"sensor '{name[:60]}' is of type {kind[:40]}", f"possible are {', '.join(PROJECTIONS)}", path)
    properties = {node.get("name", ""): node.get("value", "") for node in sensor.findall("property")}
    given = {node.get("class", "adjusted"): node for node in sensor.findall("calibration")}
    calibration = given.get("adjusted", given.get("initial"))
    resolution = sensor.find("resolution")
    if resolution is None and calibration is not None:
        resolution = calibration.find("resolution")
    if resolution is None:
        raise InputError(f"sensor '{name[:60]}' has no resolution", REMEDY, path)
    size = tuple(number(resolution.get(key), f"{key} of sensor '{name}'", path) for key in ("width", "height"))
    if not all(side == int(side) and 1 <= side <= LARGEST_FORMAT_PX for side in size):
        raise InputError(f"width and height of sensor '{name[:60]}' are no format", REMEDY, path)
    if pixel_um is None and "pixel_width" in properties:
        pixel_um = 1e3 * number(properties["pixel_width"], f"pixel_width of sensor '{name}'", path)
    pixel_um = 1.0 if pixel_um is None or not SMALLEST_POSITIVE <= pixel_um <= LARGEST_NUMBER else pixel_um
    values = _values(calibration, properties, name, path)
    f = values["f"]
    if not f >= SMALLEST_POSITIVE:
        raise InputError(
            f"the focal length of sensor '{name[:60]}' is not greater than 0", "align the photographs", path
        )
    everything = properties.get("fixed", "").lower() in TRUE
    held = set(properties.get("fixed_params", "").split()) | (set(values) if everything else set())
    mm = pixel_um * 1e-3
    interior = {
        "focal_length_mm": Prior(f * mm, fixed="f" in held),
        "x0_mm": Prior(values["cx"] * mm, fixed="cx" in held or not values["cx"]),
        "y0_mm": Prior(-values["cy"] * mm, fixed="cy" in held or not values["cy"]),
    }
    lens = {key: (values[key], key) for key in RADIAL}
    lens |= {"p1": (-values["p2"], "p2"), "p2": (values["p1"], "p1")}
    lens |= {"b1": (values["b1"] / f, "b1"), "b2": (-values["b2"] / f, "b2")}
    return Camera(
        name=name,
        model="frame",
        size_px=(int(size[0]), int(size[1])),
        pixel_um=pixel_um,
        interior=interior,
        lens={key: Prior(value, fixed=theirs in held) for key, (value, theirs) in lens.items() if value},
        projection=PROJECTIONS[kind],
    )


def _values(calibration: Element | None, properties: dict[str, str], name: str, path: Path) -> dict[str, float]:
    """Calibration in pixels; what is not there is 0."""
    keys = ("f", "cx", "cy", "b1", "b2", *RADIAL, "p1", "p2")
    if calibration is None:
        if not {"focal_length", "pixel_width"} <= set(properties):
            raise InputError(
                f"sensor '{name[:60]}' has no calibration",
                "align the photographs; markers alone are given with --control",
                path,
            )
        focal = number(properties["focal_length"], f"focal_length of sensor '{name}'", path)
        pixel = number(properties["pixel_width"], f"pixel_width of sensor '{name}'", path)
        return dict.fromkeys(keys, 0.0) | {"f": focal / pixel if pixel > SMALLEST_POSITIVE else math.nan}
    if calibration.find("fx") is not None:
        message = f"the calibration of sensor '{name[:60]}' is that of an old PhotoScan"
        raise InputError(message, "open the project in a newer version and save it", path)

    def value(key: str) -> float:
        element = calibration.find(key)
        return 0.0 if element is None else number(element.text, f"{key} of sensor '{name}'", path)

    for key in NOT_EXPRESSED:
        if value(key):
            raise InputError(f"{key} of sensor '{name[:60]}' cannot be expressed", f"adjust without {key}", path)
    return {key: value(key) for key in keys}


def rotation_of(values: np.ndarray, what: str, path: Path) -> np.ndarray:
    """(3, 3) a rotation of nine numbers, row by row, freed of rounding.

    Raises
    ------
    InputError
        When they are none.
    """
    return rotation_matrix(values, InputError(f"{what[:80]} is no rotation", REMEDY, path))


Transform = tuple[np.ndarray, np.ndarray, float]
"""Rotation (3, 3), translation (3,) and scale: X = t + s·R·x."""


def transform_of(chunk: Element, path: Path) -> Transform | None:
    """The transformation of the chunk or its active component; None where there is none.

    Raises
    ------
    InputError
    """
    for owner in (*components_of(chunk)[:1], chunk):
        found = _transform_in(owner, path)
        if found is not None:
            return found
    return None


def components_of(chunk: Element) -> list[Element]:
    """The components, the active one first."""
    components = chunk.find("components")
    if components is None:
        return []
    active = components.get("active_id")
    return sorted(components, key=lambda part: part.get("id") != active)


def other_components(chunk: Element, path: Path) -> dict[str, tuple[str, Transform | None]]:
    """Label, and transformation into the axes of the active component, of the others by id; None where not known.

    Raises
    ------
    InputError
    """
    active, found = transform_of(chunk, path), {}
    for part in components_of(chunk)[1:]:
        own = _transform_in(part, path)
        between = None
        if active is not None and own is not None:
            (turn, move, scale), (r, t, s) = active, own
            between = turn.T @ r, turn.T @ (t - move) / scale, s / scale
        found[part.get("id", "")] = (part.get("label", ""), between)
    return found


def _transform_in(owner: Element, path: Path) -> Transform | None:
    found = owner.find("transform")
    if found is None or found.find("rotation") is None:
        return None
    rotation = rotation_of(numbers(found.find("rotation"), 9, "the chunk's rotation", path), "the chunk's", path)
    translation = numbers(found.find("translation"), 3, "the chunk's translation", path)
    scale = numbers(found.find("scale"), 1, "the chunk's scale", path)[0]
    if scale < SMALLEST_POSITIVE:
        raise InputError("the chunk's scale is not greater than 0", REMEDY, path)
    return rotation, translation, float(scale)


def crs_of(chunk: Element, path: Path) -> str:
    """'EPSG:n', 'EPSG:n+m' or 'local'.

    Raises
    ------
    InputError
        For a system without a code, or when cameras or markers count in another one.
    """
    text = text_of(chunk.find("reference"))
    for part in chunk:
        words, what = text_of(part), part.tag.lower()
        if words.startswith(SYSTEMS) and words != text and ("camera" in what or "marker" in what):
            message = f"<{part.tag[:40]}>: it counts in another coordinate system than the chunk"
            raise InputError(message, "choose one for the chunk, cameras and markers (reference settings)", path)
    if not text or text.startswith("LOCAL_CS"):
        return "local"
    found = AUTHORITY.search(text)
    if found and not text.startswith("COMPD_CS"):
        return f"EPSG:{found[1]}"
    code = _codes(text)
    if code is None:
        message = "its coordinate system has no EPSG code"
        raise InputError(message, "choose one that has, in the reference settings of Metashape", path)
    return code


def _codes(text: str) -> str | None:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        whole = CRS.from_wkt(text)
        parts = whole.sub_crs_list if whole.is_compound else [whole]
        codes = [(part.source_crs or part).to_epsg() if part.is_bound else part.to_epsg() for part in parts]
    except (CRSError, ValueError, RecursionError):
        return None
    return None if None in codes or not codes else "EPSG:" + "+".join(str(code) for code in codes)


def accuracies_of(chunk: Element, path: Path) -> dict[str, float]:
    """σ of tie points and markers in the image (pixels), markers and cameras on the ground (m).

    Raises
    ------
    InputError
    """
    given = {node.get("name", ""): node.get("value", "") for node in chunk.findall("settings/property")}
    found = dict(ACCURACIES)
    for key in ACCURACIES:
        text = given.get(f"accuracy_{key}")
        if text:
            value = number(text.replace("/", " ").split()[0] if text.split() else text, f"accuracy_{key}", path)
            found[key] = value if value >= SMALLEST_POSITIVE else found[key]
    return found


def place_of(reference: Element, default: float, path: Path) -> tuple[list[float], list[float]]:
    """Coordinates, NaN where there is none, and their σ.

    Raises
    ------
    InputError
    """
    xyz = [number(reference.get(key), key, path) if reference.get(key) else math.nan for key in ("x", "y", "z")]
    sigma = []
    for own, common in (("sx", ("sxy", "sxyz")), ("sy", ("sxy", "sxyz")), ("sz", ("sxyz",))):
        text = next((reference.get(key) for key in (own, *common) if reference.get(key)), None)
        value = default if text is None else number(text, own, path)
        if value > 0.0 and impossible_sigmas(np.array(value)):
            raise InputError(f"{own} of a reference {why_impossible(value)}", REMEDY_OF_SIGMA, path)
        sigma.append(value if value > 0.0 else default)
    return xyz, sigma
