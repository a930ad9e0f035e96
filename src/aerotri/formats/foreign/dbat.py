"""Scripts of DBAT, the Damped Bundle Adjustment Toolbox: an XML file and the tables it names, read into a `Block`.

DBAT's pixels count from 1 at the CENTRE of the upper left pixel, column to the right, row down: half a pixel is taken
off, here and from the principal point (`dbat_camera`). Angles are ω, φ, κ with the rotation of `conventions`. Its
standard deviations of image points are pixels. Points are named by their id, images by the file they lie in.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from aerotri.conventions import RADIANS_PER, FilePath, InputError, mm_from_px
from aerotri.formats.foreign.dbat_camera import ASPECT, DbatCamera, estimated_elements, read_camera
from aerotri.formats.foreign.dbat_script import Script, one, read_script
from aerotri.formats.text.table_checks import refuse_duplicates, sigma_columns
from aerotri.formats.text.tables import LARGEST_NUMBER, SMALLEST_POSITIVE, Columns, Table, read_table
from aerotri.formats.text.xml_text import read_xml, text_of
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    Control,
    GnssIns,
    ImagePoints,
    Images,
    Prior,
    Settings,
)

FIRST_PIXEL = 0.5
"""Position that DBAT calls 1 less its own number: what is taken off its pixel coordinates."""
ANGLE_UNITS = {"radian": "rad", "degrees": "deg", "gon": "gon"}
ELEMENTS = ("X0", "Y0", "Z0", "omega", "phi", "kappa")


def read_dbat(path: FilePath, positions: FilePath | None = None) -> Block:
    """A block from a DBAT script.

    Parameters
    ----------
    path : the script, or the folder with exactly one.
    positions : table of camera positions to be added as observations without a shift: lines ``label,X,Y,Z,accuracy``,
        metres, the label an image name.

    Raises
    ------
    InputError
        For what is missing, is no DBAT script, or cannot be expressed in a block.
    """
    script = read_script(Path(path))
    cameras, numbers = _cameras(script)
    images, ids = _images(script, numbers)
    image_points, points = _image_points(script, images, ids, cameras)
    control, points = _control(script, points)
    observed = None if positions is None else _positions(Path(positions), images)
    pixel_um = cameras[0].pixel_um
    settings = Settings(
        adjustment=_adjustment(script, cameras, images, ids, bool(len(control))),
        image_sigma_um=pixel_um,
    )
    return Block(
        script.path.stem, cameras, images, np.array(points, dtype=str), image_points, control, observed, settings
    )


def _cameras(script: Script) -> tuple[tuple[Camera, ...], list[str]]:
    """The cameras, and the numbers by which the images call them."""
    source = one(script.root, "input/cameras", script.path)
    elements, path = source.findall("camera"), script.path
    if not elements:
        path = script.file(text_of(one(source, "file", script.path)))
        elements = read_xml(path).findall("cameras/camera")
    if not elements:
        raise InputError("there is no <camera>", "describe the camera", path)
    default = any(_starts_from_defaults(element, script) for element in script.operations("set_initial_values/io"))
    found = [read_camera(element, default, path) for element in elements]
    estimated = _estimated(script)
    return tuple(camera.camera(estimated) for camera in _named_apart(found)), [camera.number for camera in found]


def _estimated(script: Script) -> frozenset[str]:
    """Elements of the cameras that the bundle estimates."""
    chosen = script.operations("set_bundle_estimate_params/io")
    return estimated_elements(chosen[-1] if chosen else None, script.path)


def _starts_from_defaults(element: Element, script: Script) -> bool:
    for tag, text in [(child.tag, text_of(child)) for child in element] or [("all", text_of(element))]:
        plain = {"all": ("loaded", "default"), "aspect": ("1", "default"), "skew": ("0", "default")}
        if text not in plain.get(tag, ()) and text != "loaded":
            raise InputError(
                f"<io><{tag}> starts from '{text}'", "set the value in the camera and start from loaded", script.path
            )
    return text_of(element) == "default" or text_of(element.find("all")) == "default"


def _named_apart(cameras: list[DbatCamera]) -> list[DbatCamera]:
    names = [camera.name for camera in cameras]
    if len(set(names)) == len(names):
        return cameras
    return [DbatCamera(c.number, f"{c.name} {i}", c.size_px, c.pixel_mm, c.values) for i, c in enumerate(cameras, 1)]


def _images(script: Script, camera_numbers: list[str]) -> tuple[Images, list[str]]:
    """The images with start values, and the ids by which the measurements call them."""
    table = script.table(one(script.root, "input/images/file", script.path), ("id",), ("path", "label", "cam"))
    refuse_duplicates(table, table.text["id"].index, lambda row: f"image '{table.cell('id', row)}'")
    ids = table.text["id"].rows().tolist()
    if not ids:
        raise InputError("holds no images", "give a row for every photograph", table.path)
    source = next(field for field in ("path", "label", "id") if field in table.text)
    names = np.array([re.split(r"[/\\]", text)[-1] for text in table.text[source].rows().tolist()], dtype=str)
    if len(set(names.tolist())) < len(names):
        raise InputError("two images have the same file name", "images are told apart by it", table.path)
    camera = np.zeros(len(names), np.int64)
    if "cam" in table.text:
        for row, number in enumerate(table.text["cam"].rows().tolist()):
            if number not in camera_numbers:
                raise table.error(row, f"there is no camera '{number}'", f"there are {', '.join(camera_numbers)}")
            camera[row] = camera_numbers.index(number)
    elif len(camera_numbers) > 1:
        raise InputError("there are several cameras", "add a field cam to the table of images", table.path)
    centre, angles = _start_values(script, ids)
    return Images(names, camera, np.full(len(names), ""), centre, angles), ids


def _start_values(script: Script, ids: list[str]) -> tuple[np.ndarray, np.ndarray]:
    centre, angles = np.full((len(ids), 3), np.nan), np.full((len(ids), 3), np.nan)
    file = script.root.find("input/prior_eo/file")
    if file is None:
        return centre, angles
    table = script.table(file, ("id", "x", "y", "z"), ("omega", "phi", "kappa"))
    rows = _rows_of(table, "id", ids, "image")
    refuse_duplicates(table, rows, lambda row: f"image '{table.cell('id', row)}'")
    centre[rows] = table.stack("x", "y", "z")
    if "omega" in table.numbers:
        unit = ANGLE_UNITS.get(file.get("units", ""))
        if unit is None:
            raise InputError("prior_eo gives angles without their unit", 'add units="degrees"', script.path)
        angles[rows] = table.stack("omega", "phi", "kappa") * RADIANS_PER[unit]
    return centre, angles


def _rows_of(table: Table, field: str, known: list[str], what: str) -> np.ndarray:
    """(n,) index into `known` of the names in a text column."""
    place = {name: i for i, name in enumerate(known)}
    column = table.text[field]
    index = np.array([place.get(name, -1) for name in column.names.to_pylist()], dtype=np.int64)[column.index]
    unknown = np.flatnonzero(index < 0)
    if len(unknown):
        row = int(unknown[0])
        raise table.error(
            row, f"there is no {what} '{table.cell(field, row)}'", f"known are {what}s such as {known[0]}"
        )
    return index


def _image_points(
    script: Script, images: Images, ids: list[str], cameras: tuple[Camera, ...]
) -> tuple[ImagePoints, list[str]]:
    place: dict[str, int] = {}
    parts = []
    for file in script.root.findall("input/image_pts/file"):
        table = script.table(file, ("id", "im", "x", "y"), ("sx", "sy", "sxy"))
        image = _rows_of(table, "im", ids, "image")
        column = table.text["id"]
        number = np.array([place.setdefault(name, len(place)) for name in column.names.to_pylist()], dtype=np.int64)
        point = number[column.index]
        refuse_duplicates(
            table,
            image * len(place) + point,
            lambda row, t=table: f"point '{t.cell('id', row)}' in image '{t.cell('im', row)}'",
        )
        parts.append((image, point, table.stack("x", "y") - FIRST_PIXEL, _sigma_px(table, file)))
    if not parts:
        raise InputError("there are no image points", "add <image_pts><file>", script.path)
    image, point, px, sigma = (np.concatenate(part) for part in zip(*parts, strict=True))
    if len(np.unique(image * len(place) + point)) < len(image):
        raise InputError("two tables measure the same point in the same image", "keep one", script.path)
    xy, pixel_mm = np.empty_like(px), np.array([camera.pixel_mm for camera in cameras])[images.camera[image]]
    for number, camera in enumerate(cameras):
        own = images.camera[image] == number
        xy[own] = mm_from_px(px[own], camera.size_px, camera.pixel_mm)
    return ImagePoints(image, point, xy, sigma * pixel_mm[:, None]), list(place)


def _sigma_px(table: Table, file: Element) -> np.ndarray:
    """(m, 2) pixels: of the table, overruled by the attributes of the file element as in DBAT."""
    given = table.stack("sxy" if "sxy" in table.numbers else "sx", "sxy" if "sxy" in table.numbers else "sy")
    for attribute, columns in (("sxy", (0, 1)), ("sx", (0,)), ("sy", (1,))):
        text = file.get(attribute)
        if text is not None:
            given[:, columns] = _positive(text, attribute, table.path)
    values = Table(table.path, table.length, {}, {"sx": given[:, 0], "sy": given[:, 1]}, table.source)
    everywhere = np.ones((table.length, 2), bool)
    return sigma_columns(values, ("sx", "sy"), everywhere, np.full(2, np.nan), 'add sxy="1" to <file>, in pixels')


def _positive(text: str, name: str, path: Path) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not SMALLEST_POSITIVE <= value <= LARGEST_NUMBER:
        raise InputError(f"{name} = '{text[:60]}' is not a standard deviation", "give pixels, greater than 0", path)
    return value


def _control(script: Script, measured: list[str]) -> tuple[Control, list[str]]:
    place = {name: i for i, name in enumerate(measured)}
    parts = []
    for tag in ("ctrl_pts", "check_pts"):
        for section in script.root.findall(f"input/{tag}"):
            table = script.table(
                one(section, "file", script.path), ("id", "x", "y", "z"), ("sx", "sy", "sz", "sxy", "sxyz")
            )
            names = table.text["id"].rows()
            keep = _filtered(section, names, script.path)
            number = [place.setdefault(name, len(place)) for name in names[keep].tolist()]
            xyz, sigma = table.stack("x", "y", "z")[keep], _control_sigma(table, keep)
            parts.append((np.array(number, np.int64), xyz, sigma, np.full(len(number), tag == "check_pts")))
    if not parts:
        return Control.empty(), measured
    control = Control(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    if len(np.unique(control.point)) < len(control):
        raise InputError("a point is given twice as control or check point", "filter one of them out", script.path)
    return control, list(place)


def _filtered(section: Element, names: np.ndarray, path: Path) -> np.ndarray:
    """(k,) bool after the section's filters, one after the other."""
    keep = np.ones(len(names), bool)
    for element in section.findall("filter"):
        named = np.isin(names, [part.strip() for part in element.get("id", "").split(",")])
        verb = text_of(element)
        if verb not in ("keep", "remove"):
            raise InputError(f"there is no filter '{verb}'", "a filter is keep or remove", path)
        keep &= named if verb == "keep" else ~named
    return keep


def _control_sigma(table: Table, keep: np.ndarray) -> np.ndarray:
    given = table.stack("sx", "sy", "sz")
    for field, columns in (("sxy", (0, 1)), ("sxyz", (0, 1, 2))):
        if field in table.numbers:
            given[:, columns] = table.numbers[field][:, None]
    numbers = {name: given[:, k] for k, name in enumerate(("sx", "sy", "sz"))}
    values = Table(table.path, table.length, {}, numbers, table.source)
    wanted = np.repeat(keep[:, None], 3, axis=1)
    # a coordinate without standard deviation is free of error to DBAT
    return sigma_columns(values, ("sx", "sy", "sz"), wanted, np.zeros(3), "", True, on_ground=True)[keep]


def _adjustment(
    script: Script, cameras: tuple[Camera, ...], images: Images, ids: list[str], has_control: bool
) -> AdjustmentSettings:
    _refuse_partial_estimation(script)
    free = [name for name, prior in _brown_of_all(cameras).items() if not prior.fixed]
    # DBAT stretches x before the lens, b1 after it: the same but for the product of both
    free += ["b1"] if ASPECT in _estimated(script) else []
    parameters = (("brown", tuple(free)),) if free else ()
    datum = script.operations("set_datum")
    if datum:
        fixed = _depend(datum[-1], images, ids, script.path)
        return AdjustmentSettings(additional_parameters=parameters, datum="fixed", datum_fixed=fixed)
    return AdjustmentSettings(additional_parameters=parameters, datum="control" if has_control else "minimal")


def _brown_of_all(cameras: tuple[Camera, ...]) -> dict[str, Prior]:
    return {name: prior for camera in cameras for name, prior in camera.brown.items()}


def _refuse_partial_estimation(script: Script) -> None:
    """All orientations and points are estimated here; a script that holds some is another adjustment."""
    for part in ("eo", "op"):
        for element in script.operations(f"set_bundle_estimate_params/{part}"):
            for tag, text in [(child.tag, text_of(child)) for child in element] or [("all", text_of(element))]:
                if (tag, text) not in (("all", "true"), ("all", "default")):
                    raise InputError(
                        f"<{part}><{tag}> is '{text}'", "estimate all orientations and points", script.path
                    )


def _depend(element: Element, images: Images, ids: list[str], path: Path) -> tuple[tuple[str, str], ...]:
    """Elements held by the dependent relative orientation: all of one image and one coordinate of another."""
    base, reference = element.get("ref_base", "longest"), element.get("ref_cam", "1")
    if text_of(element) != "depend" or base not in ("longest", "x", "y", "z"):
        raise InputError(
            f"the datum '{text_of(element)}' with ref_base '{base}' is not known", "use depend, longest", path
        )
    if reference not in ids:
        raise InputError(f"ref_cam = '{reference}' is not an image", f"it is an id such as {ids[0]}", path)
    first = ids.index(reference)
    if np.isnan(images.centre).any():
        raise InputError("the datum needs start values of all images", "add <prior_eo>", path)
    among = [0, 1, 2] if base == "longest" else ["xyz".index(base)]
    image, axis = _longest_offset(images.centre[:, among], first)
    held = [(str(images.names[first]), name) for name in ELEMENTS]
    return (*held, (str(images.names[image]), ELEMENTS[among[axis]]))


def _longest_offset(centre: np.ndarray, reference: int) -> tuple[int, int]:
    """Image and axis of the largest (signed) offset from the reference image, as DBAT finds its base."""
    offset = centre - centre[reference]
    image, axis = np.unravel_index(int(np.argmax(offset)), offset.shape)
    return int(image), int(axis)


def _positions(path: Path, images: Images) -> GnssIns:
    """Camera positions of a table ``label,X,Y,Z,accuracy`` as observations."""
    columns = Columns(text=("label",), numbers=("X", "Y", "Z", "accuracy"))
    table = read_table(path, columns, ("label", "X", "Y", "Z", "accuracy"))
    table.require("label", "X", "Y", "Z", "accuracy")
    image = _rows_of(table, "label", images.names.tolist(), "image")
    refuse_duplicates(table, image, lambda row: f"image '{table.cell('label', row)}'")
    xyz = table.stack("X", "Y", "Z")
    everywhere = np.ones((table.length, 1), bool)
    sigma = sigma_columns(table, ("accuracy",), everywhere, np.full(1, np.nan), "give it in m", on_ground=True)
    unknown = np.full_like(xyz, np.nan)
    return GnssIns(image, xyz, np.repeat(sigma, 3, axis=1), unknown, unknown, unknown[:, 0])
