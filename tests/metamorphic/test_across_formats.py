"""One simulated block in the format of every program: the same adjustment, and what a format cannot carry is named."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from transformations import by_names, largest_difference, numbers_of, same, with_names

import aerotri
from aerotri.functional_model.rotation import logarithm, rotation_from_angles
from small_blocks import with_adjustment

CRS, PIXEL_UM, SIGMA_UM = "EPSG:25832", 2.4, 1.2
LENS = {"k1": -0.05, "k2": 0.01}
FREE = (("lens", ("k1", "k2")),)
DOWN = np.diag([1.0, -1.0, -1.0])


def plan():
    stated = {name: {"value": value, "fixed": False} for name, value in LENS.items()}
    flight = aerotri.example_flight()
    flight["flight"] |= {"images_per_strip": 5}
    flight["tie_points"] |= {"per_image": 40}
    flight["camera"]["camera"] |= {
        "lens": stated, "interior": {"focal_length_mm": {"value": 8.8}}, "errors": {"lens": LENS},
    }  # fmt: skip
    place = {"crs": CRS, "origin": [680000.0, 5300000.0, 400.0]}
    return flight | {"gnss": {"sigma_m": [0.03, 0.03, 0.05]}, "georeference": place}


@pytest.fixture(scope="module")
def original():
    """The block with numbers as names of its points, its result and the numbers of that."""
    block = aerotri.simulate(plan(), seed=3).block
    block = with_names(block, {name: str(1000 + k) for k, name in enumerate(block.points.tolist())})
    block = with_adjustment(block, additional_parameters=FREE)
    result = aerotri.adjust(block)
    return block, result, numbers_of(result.adjusted, same(block))


@dataclass(frozen=True)
class Carried:
    """How the block goes through a format, and what is lost there.

    Parameters
    ----------
    target : format or formats to write, with their files. options : of `aerotri.read` besides.
    digits : σ by which adjusted values may differ, from the digits of the format.
    numbered : first number of points where their names are lost. lost : words that name what it cannot carry, of the
        writer's notes. assumed : words of what is assumed in import.json. has_control, has_gnss : whether it carries.
    """

    target: dict[str, str]
    digits: float
    options: dict = field(default_factory=dict)
    numbered: int | None = None
    lost: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    has_control: bool = False
    has_gnss: bool = False


SIGMA, NO_CONTROL, NO_GNSS = "standard deviations of 4", "control", "observ"
ONE_PIXEL, PIXEL, PLACE = "assumed as 1 pixel", "size of the pixels", "coordinates are local"
FULL, NANOMETRE, MICROPIXEL = 1e-6, 2e-3, 2e-5
"""σ. All digits of a number: start values differ, and the last step of the adjustment leaves 1e-7. Six decimals of a
millimetre: 5e-7 mm are 4e-4 of the σ of an image point, and points add up some of them. Six decimals of a pixel are
2e-6 of it."""
OF_IMAGES = (SIGMA, NO_CONTROL, NO_GNSS, PIXEL, PLACE)
FORMATS = {
    "block": Carried({"block": "block"}, 1e-9, has_control=True, has_gnss=True),
    "colmap": Carried({"colmap": "model"}, FULL, lost=OF_IMAGES, assumed=("counts as 1 µm", ONE_PIXEL)),
    "colmap-text": Carried({"colmap-text": "model"}, FULL, lost=OF_IMAGES, assumed=("counts as 1 µm", ONE_PIXEL)),
    "opensfm": Carried({"opensfm": "model"}, FULL, lost=OF_IMAGES, assumed=("counts as 1 µm", ONE_PIXEL)),
    "bundler": Carried({"bundler": "model"}, FULL, numbered=0, lost=(*OF_IMAGES, "names of"),
                       assumed=("counts as 1 µm", ONE_PIXEL)),
    "blocks-exchange": Carried({"blocks-exchange": "block.xml"}, FULL, lost=(SIGMA,), assumed=(ONE_PIXEL,),
                               has_control=True, has_gnss=True),
    "bingo": Carried({"bingo": "rays.txt", "metashape": "opk.txt"}, NANOMETRE, {"orientation": "opk.txt"},
                     lost=(SIGMA, NO_CONTROL, NO_GNSS, "lens", "system", "orientation"), assumed=(ONE_PIXEL,)),
    "ign-mes": Carried({"ign-mes": "rays.mes", "pix4d-eo": "eo.txt"}, MICROPIXEL, {"orientation": "eo.txt"},
                       lost=(SIGMA, NO_CONTROL, NO_GNSS, "lens", "coordinate system"), assumed=(ONE_PIXEL,)),
    "openmvg": Carried({"openmvg": "sfm_data.json"}, FULL, assumed=("counts as 1 µm", ONE_PIXEL)),
    "nvm": Carried({"nvm": "model.nvm"}, FULL, {"camera_size": (5472, 3648)}, numbered=1,
                   assumed=("counts as 1 µm", ONE_PIXEL)),
    "realitycapture": Carried({"bingo": "rays.txt", "realitycapture": "rc.csv"}, NANOMETRE, {"orientation": "rc.csv"},
                              assumed=(ONE_PIXEL,)),
    "patb": Carried({"patb": "patb"}, NANOMETRE, {"patb_rotation": "camera-to-object"},
                    lost=(SIGMA, NO_GNSS, "check point", "lens", "coordinate system"), assumed=(ONE_PIXEL,)),
}  # fmt: skip


OF_LISTS = {
    "named": "name,X,Y,Z,sX,sY,sZ",
    "metashape": "#Label,X/Easting,Y/Northing,Z/Altitude,Accuracy_X/Easting_(m),Accuracy_Y/Northing_(m),"
    "Accuracy_Z/Altitude_(m)",
}
"""The line that names the columns, of any program and of Metashape's reference pane."""


def listed(path: Path, names, xyz, sigma) -> Path:
    """A list with names of columns and every digit."""
    header = OF_LISTS["metashape" if path.stem == "gnss" else "named"]
    rows = (",".join([name, *map(repr, [*place, *spread])]) for name, place, spread in
            zip(names.tolist(), xyz.tolist(), sigma.tolist(), strict=True))  # fmt: skip
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


def lists_of(block, folder: Path, names) -> dict:
    """Options of control points, check points and positions, for formats without."""
    control, observed = block.control, block.gnss_ins
    of_points = np.array([names.get(name, name) for name in block.points[control.point].tolist()])
    return {
        "control": listed(folder / "control.csv", of_points, control.xyz, control.sigma),
        "positions": listed(folder / "gnss.csv", block.images.names[observed.image], observed.xyz, observed.sigma),
        "check": of_points[control.is_check].tolist(), "crs": CRS,
    }  # fmt: skip


def settled(block, like):
    """The block with the lens and the elements held as in the other: settings, which no format has."""
    (own,), (camera,) = block.cameras, like.cameras
    interior = {name: replace(prior, fixed=camera.interior[name].fixed) for name, prior in own.interior.items()}
    lens = own.lens if own.lens else camera.lens
    lens = {name: replace(lens[name], fixed=False) for name in LENS}
    block = replace(block, cameras=(replace(own, interior=interior, lens=lens),))
    return with_adjustment(block, additional_parameters=FREE)


def local_in_pixels(result, folder: Path):
    """The adjusted block in local axes, as programs of structure from motion have it, and pixels of its rays."""
    aerotri.convert(result, folder / "local", "opensfm")
    read = aerotri.read(folder / "local", pixel_um=PIXEL_UM)
    (camera,), rays = read.block.cameras, read.block.image_points
    size = np.array(camera.size_px)
    px = rays.xy / camera.pixel_mm * [1.0, -1.0] + size / 2.0
    turn = rotation_from_angles(read.block.images.angles)
    return read, px, [DOWN @ matrix.T for matrix in turn]


def write_openmvg(result, path: Path) -> None:
    """sfm_data.json by OpenMVG's sources: pixels from the corner, rotations from the world, row by row."""
    read, px, turns = local_in_pixels(result, path.parent)
    (camera,), images, rays = read.block.cameras, read.block.images, read.block.image_points
    focal = camera.focal_length_mm / camera.pixel_mm
    lens = [camera.lens["k1"].value, camera.lens["k2"].value, 0.0]
    width, height = camera.size_px
    own = {"width": width, "height": height, "focal_length": focal, "principal_point": [width / 2, height / 2],
           "disto_k3": lens}  # fmt: skip
    views = [{"value": {"ptr_wrapper": {"data": {"filename": name, "width": width, "height": height, "id_view": k,
                                                 "id_intrinsic": 0, "id_pose": k}}}}
             for k, name in enumerate(images.names.tolist())]  # fmt: skip
    structure = [
        {"key": int(name), "value": {"X": read.points[p].tolist(), "observations": [
            {"key": int(rays.image[k]), "value": {"id_feat": 0, "x": px[k].tolist()}}
            for k in np.flatnonzero(rays.point == p)]}}
        for p, name in enumerate(read.block.points.tolist())
    ]  # fmt: skip
    poses = [{"key": k, "value": {"rotation": turn.tolist(), "center": images.centre[k].tolist()}}
             for k, turn in enumerate(turns)]  # fmt: skip
    content = {
        "sfm_data_version": "0.3", "root_path": "/photos",
        "views": [{"key": k} | view for k, view in enumerate(views)], "extrinsics": poses, "structure": structure,
        "intrinsics": [{"key": 0, "value": {"ptr_wrapper": {"data": own}, "polymorphic_name": "pinhole_radial_k3"}}],
    }  # fmt: skip
    path.write_text(json.dumps(content), encoding="utf-8")


def write_nvm(result, path: Path) -> None:
    """NVM_V3 by VisualSFM's manual: image points as measured, from the image centre; no lens."""
    read, px, turns = local_in_pixels(result, path.parent)
    (camera,), images, rays = read.block.cameras, read.block.images, read.block.image_points
    lines = ["NVM_V3", "", str(len(images))]
    for name, centre, turn in zip(images.names.tolist(), images.centre.tolist(), turns, strict=True):
        about = logarithm(turn)
        angle = np.linalg.norm(about)
        quaternion = [np.cos(angle / 2.0), *(np.sin(angle / 2.0) * about / angle)]
        values = [camera.focal_length_mm / camera.pixel_mm, *quaternion, *centre, 0.0]
        lines.append(f"{name} " + " ".join(repr(float(value)) for value in values) + " 0")
    at = (px - np.array(camera.size_px) / 2.0).tolist()
    lines += ["", str(len(read.points))]
    for p, xyz in enumerate(read.points.tolist()):
        own = np.flatnonzero(rays.point == p).tolist()
        seen = " ".join(f"{rays.image[k]} {k} {at[k][0]!r} {at[k][1]!r}" for k in own)
        lines.append(" ".join(map(repr, xyz)) + f" 255 255 255 {len(own)} {seen}")
    path.write_text("\n".join([*lines, "", "0", ""]), encoding="utf-8")


def write_realitycapture(result, path: Path) -> None:
    """Registrations: R = Rz(-heading)·Rx(pitch)·Ry(roll), camera to grid."""
    adjusted = result.adjusted
    rows = ["#name,x,y,alt,heading,pitch,roll"]
    turns = rotation_from_angles(adjusted.images.angles, adjusted.block.rotation)
    for name, place, r in zip(
        adjusted.block.images.names.tolist(), adjusted.images.centre.tolist(), turns, strict=True
    ):
        angles = np.degrees([-np.arctan2(-r[0, 1], r[1, 1]), np.arcsin(r[2, 1]), np.arctan2(-r[2, 0], r[2, 2])])
        rows.append(",".join([name, *map(repr, [*place, *angles.tolist()])]))
    path.write_text("\n".join([*rows, ""]), encoding="utf-8")


WRITERS = {"openmvg": write_openmvg, "nvm": write_nvm, "realitycapture": write_realitycapture}
"""Formats that are read and not written."""


def written(result, way: Carried, folder: Path) -> str:
    """The block in the files of a format; what their writers say is lost."""
    said = []
    for to, file in way.target.items():
        if to in WRITERS:
            WRITERS[to](result, folder / file)
        else:
            said += aerotri.convert(result, folder / file, to)
    return " | ".join(said)


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_adjustment(name, original, tmp_path):
    block, result, before = original
    way = FORMATS[name]
    lost = written(result, way, tmp_path)
    assert [words for words in way.lost if words not in lost] == []
    names = {} if way.numbered is None else {old: str(k + way.numbered) for k, old in enumerate(block.points.tolist())}
    whole = name != "patb" and "orientation" not in way.options
    options = {} if way.has_control else lists_of(block, tmp_path, names)
    if not way.has_control:
        options["pixel_um"] = PIXEL_UM
    if not whole:
        options |= {"camera_size": block.cameras[0].size_px, "focal_length_mm": 8.8, "free_interior": True}
    options |= {key: tmp_path / file if key == "orientation" else file for key, file in way.options.items()}
    if name == "patb":
        # its own control points have no σ
        (tmp_path / "patb" / "block.con").unlink()
    source = tmp_path / next(iter(way.target.values()))
    assert_named(aerotri.read(source) if whole else aerotri.read(source, **options), way, not whole)
    read = aerotri.read(source, image_sigma_um=SIGMA_UM, **options)
    again = settled(read.block, block)
    found = largest_difference(before, numbers_of(aerotri.adjust(again).adjusted, by_names(block, again, names)))
    assert {what: value for what, value in found.items() if not value <= way.digits} == {}


def assert_named(read, way: Carried, with_lists: bool) -> None:
    """import.json counts what came, and says what no file said."""
    content = read.imported.as_dict()
    taken = content["taken"]
    assert (taken["control_points"], taken["check_points"]) == ((6, 4) if way.has_control or with_lists else (0, 0))
    assert taken["gnss_positions"] == (10 if way.has_gnss or with_lists else 0)
    assert taken["start_orientations"] == 10
    assert [words for words in way.assumed if words not in " | ".join(content["assumed"])] == []


def test_table_of_the_documentation():
    """Every format has its row, with the digits and what it carries."""
    text = (Path(__file__).parents[2] / "docs" / "start" / "other_programs.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in text.partition("what-each-format-carries")[2].splitlines()]
    rows = {tuple(row[0].split("`")[1::2]): row for row in rows if len(row) == 7 and "`" in row[0]}
    for way in FORMATS.values():
        row = rows[tuple(way.target)]
        assert (row[1] == "yes", row[2] == "yes", row[3] == "no") == (
            way.has_control,
            way.has_gnss,
            way.numbered is not None,
        )
        assert float(row[6]) == way.digits
