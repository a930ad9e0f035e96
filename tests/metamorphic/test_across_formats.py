"""One simulated block in the format of every program: the same adjustment, and what a format cannot carry is named."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from transformations import by_names, largest_difference, numbers_of, same, with_names

import aerotri
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
    numbered : whether points are called by their numbers. lost : words that name what it cannot carry, of the
        writer's notes. assumed : words of what is assumed in import.json. has_control, has_gnss : whether it carries.
    """

    target: dict[str, str]
    digits: float
    options: dict[str, str] = field(default_factory=dict)
    numbered: bool = False
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
    "bundler": Carried({"bundler": "model"}, FULL, numbered=True, lost=(*OF_IMAGES, "names of"),
                       assumed=("counts as 1 µm", ONE_PIXEL)),
    "blocks-exchange": Carried({"blocks-exchange": "block.xml"}, FULL, lost=(SIGMA,), assumed=(ONE_PIXEL,),
                               has_control=True, has_gnss=True),
    "bingo": Carried({"bingo": "rays.txt", "metashape": "opk.txt"}, NANOMETRE, {"orientation": "opk.txt"},
                     lost=(SIGMA, NO_CONTROL, NO_GNSS, "lens", "system", "orientation"), assumed=(ONE_PIXEL,)),
    "ign-mes": Carried({"ign-mes": "rays.mes", "pix4d-eo": "eo.txt"}, MICROPIXEL, {"orientation": "eo.txt"},
                       lost=(SIGMA, NO_CONTROL, NO_GNSS, "lens", "coordinate system"), assumed=(ONE_PIXEL,)),
    "patb": Carried({"patb": "patb"}, NANOMETRE, {"patb_rotation": "camera-to-object"},
                    lost=(SIGMA, NO_GNSS, "check point", "lens", "coordinate system"), assumed=(ONE_PIXEL,)),
}  # fmt: skip


def listed(path: Path, names, xyz, sigma) -> Path:
    """A list with names of columns and every digit."""
    rows = (",".join([name, *map(repr, [*place, *spread])]) for name, place, spread in
            zip(names.tolist(), xyz.tolist(), sigma.tolist(), strict=True))  # fmt: skip
    path.write_text("\n".join(["name,X,Y,Z,sX,sY,sZ", *rows, ""]), encoding="utf-8")
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


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_adjustment(name, original, tmp_path):
    block, result, before = original
    way = FORMATS[name]
    lost = " | ".join(text for to, file in way.target.items() for text in aerotri.convert(result, tmp_path / file, to))
    assert [words for words in way.lost if words not in lost] == []
    names = {old: str(k) for k, old in enumerate(block.points.tolist())} if way.numbered else {}
    whole = way.has_control or name in ("colmap", "colmap-text", "opensfm", "bundler")
    options = {} if way.has_control else lists_of(block, tmp_path, names)
    if not way.has_control:
        options["pixel_um"] = PIXEL_UM
    if not whole:
        options |= {"camera_size": block.cameras[0].size_px, "focal_length_mm": 8.8, "free_interior": True}
    options |= {key: tmp_path / file if key == "orientation" else file for key, file in way.options.items()}
    assert_named(aerotri.read(tmp_path / next(iter(way.target.values()))), way) if whole else None
    if name == "patb":
        # its own control points have no σ
        (tmp_path / "patb" / "block.con").unlink()
    read = aerotri.read(tmp_path / next(iter(way.target.values())), image_sigma_um=SIGMA_UM, **options)
    again = settled(read.block, block)
    found = largest_difference(before, numbers_of(aerotri.adjust(again).adjusted, by_names(block, again, names)))
    assert {what: value for what, value in found.items() if not value <= way.digits} == {}


def assert_named(read, way: Carried) -> None:
    """import.json counts what came, and says what no file said."""
    content = read.imported.as_dict()
    taken = content["taken"]
    assert (taken["control_points"], taken["check_points"]) == ((6, 4) if way.has_control else (0, 0))
    assert taken["gnss_positions"] == (10 if way.has_gnss else 0)
    assert taken["start_orientations"] == 10
    assert [words for words in way.assumed if words not in " | ".join(content["assumed"])] == []
