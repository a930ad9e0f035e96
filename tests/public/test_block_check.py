"""What `aerotri.check` says of a block before it is adjusted, and that `adjust` agrees."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from photographed import PLAN

import aerotri
from aerotri import AdjustmentFailedError, InputError
from aerotri.cli.app import invoke
from aerotri.diagnosis.inventory import inventory
from aerotri.diagnosis.suspicions import suspicions
from aerotri.formats.block.writer import write_block
from aerotri.observations.names import alike
from places import PROJECT
from ten_photographs import (
    ten_photographs,
    with_attitudes,
    with_control,
    with_image_points,
    with_positions,
    with_strips_apart,
    without_start_values,
)

SAMPLE = PROJECT / "blocks" / "frederiksstad_ultracam"


@pytest.fixture(scope="module")
def ten():
    return ten_photographs()


def said(block) -> str:
    return "\n".join(suspicions(block, inventory(block), "degrees"))


def test_a_faultless_block(ten, tmp_path, capsys):
    """What it holds, nothing missing, nothing suspicious; as text and as JSON."""
    write_block(ten, tmp_path / "ten")
    found = aerotri.check(tmp_path / "ten")
    counts, rays = found.inventory, ten.image_points
    assert found.can_be_adjusted
    assert found.warnings == ()
    assert found.notes == ()
    assert (counts.photographs, counts.with_gnss, counts.with_ins) == (10, 10, 10)
    assert [(strip.name, strip.photographs) for strip in counts.strips] == [("1", 5), ("2", 5)]
    in_both = set(rays.point[ten.images.strip[rays.image] == "1"]) & set(
        rays.point[ten.images.strip[rays.image] == "2"]
    )
    assert {strip.common_points for strip in counts.strips} == {len(in_both)}
    per_point = np.bincount(rays.point)
    assert counts.image_points.rays_per_point == {k: int((per_point == k).sum()) for k in np.unique(per_point) if k}
    assert counts.check.count == 8
    extents = {one.name: one for one in counts.extents}
    assert extents["GNSS"].low == pytest.approx(ten.gnss_ins.xyz.min(axis=0))
    assert invoke(["check", str(tmp_path / "ten"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["image_points"]["count"] == len(rays)
    assert told["missing"] == []
    assert invoke(["check", str(tmp_path / "ten")]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "The block can be adjusted."
    assert "<li>" in found._repr_html_()


def test_files_that_are_not_read_are_said(ten, tmp_path, capsys):
    """A table under a wrong name is named with the right one, by check and by adjust; other files only by name."""
    write_block(replace(ten, gnss_ins=None), tmp_path / "ten")
    table = "image,X,Y,Z,sX,sY,sZ\n1_001,0,0,900,0.1,0.1,0.1\n"
    (tmp_path / "ten" / "positions.csv").write_text(table)
    (tmp_path / "ten" / "Constraint.CSV").write_text("nothing of use")
    (tmp_path / "ten" / "weather.csv").write_text("day,wind\n1,3\n")
    (tmp_path / "ten" / "README.txt").write_text("mine")
    sentences = (
        "Constraint.CSV is not read: it seems to be constraints.csv; rename it",
        "positions.csv is not read: it seems to be gnss_ins.csv; rename it",
        "not read, as a block has no such table: weather.csv",
    )
    assert aerotri.check(tmp_path / "ten").notes == sentences
    assert aerotri.adjust(tmp_path / "ten").notes == sentences
    out = ["--out", str(tmp_path / "out"), "--no-plots"]
    assert invoke(["adjust", str(tmp_path / "ten"), *out]) == 0
    assert [f"aerotri: {text}" for text in sentences] == [
        line for line in capsys.readouterr().err.splitlines() if "not read" in line
    ]


def test_nothing_is_said_of_what_aerotri_wrote(ten, tmp_path):
    """The list of control points beside rendered photographs is no table of the block."""
    plan = PLAN | {"georeference": {"crs": "EPSG:32632", "origin": [6.8e5, 5.3e6, 500.0]}}
    folder = aerotri.simulate(plan, seed=3).save(tmp_path / "flight", photographs=True, only=["1_001"])
    assert (folder / "gcp_list.txt").is_file()
    assert aerotri.check(folder).notes == ()


def test_a_misnamed_table_is_pointed_at(ten, tmp_path):
    """A table that has to be there: the near name stands in the refusal, exit code 2."""
    write_block(ten, tmp_path / "ten")
    (tmp_path / "ten" / "images.csv").rename(tmp_path / "ten" / "image.csv")
    with pytest.raises(InputError, match=r"there is image\.csv: rename it"):
        invoke(["check", str(tmp_path / "ten")])


def _two_control_points(block):
    control, is_check = block.control, block.control.is_check.copy()
    is_check[np.flatnonzero(~is_check)[2:]] = True
    return replace(block, control=replace(control, is_check=is_check), gnss_ins=None)


def _no_control(block):
    return replace(block, control=replace(block.control, is_check=np.ones(len(block.control), bool)), gnss_ins=None)


def _by_strips(block):
    return aerotri.with_settings(block, start="strips")


def _free(block):
    adjustment = replace(block.settings.adjustment, datum="minimal")
    return replace(_no_control(block), settings=replace(block.settings, adjustment=adjustment))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda block: block, ""),
        (_free, ""),
        (_no_control, "no control: the datum is free in X, Y, Z, ω, φ, κ, scale"),
        (_two_control_points, "too little control: the datum is free in"),
        (lambda block: _by_strips(without_start_values(_free(block))), "no photograph has start values"),
        (lambda block: without_start_values(_free(block)), ""),
        (without_start_values, ""),
    ],
    ids=["faultless", "free", "no control", "two points", "no start values, free", "tie points", "no start values"],
)
def test_what_is_missing_is_what_adjust_lacks(ten, change, reason):
    """`can_be_adjusted` and the adjustment agree; the reason is the same."""
    block = change(ten)
    found = aerotri.check(block)
    assert found.can_be_adjusted == (not reason)
    assert all(reason in text for text in found.missing)
    if reason:
        with pytest.raises((AdjustmentFailedError, InputError)):
            aerotri.adjust(block)
    else:
        assert aerotri.adjust(block).status == "converged"


def test_without_image_points(ten, tmp_path, capsys):
    """An empty table is no error of reading: it is what is missing, exit code 1."""
    write_block(ten, tmp_path / "ten")
    (tmp_path / "ten" / "image_points.csv").write_text("image,point,x,y\n")
    assert invoke(["check", str(tmp_path / "ten")]) == 1
    assert "missing: there are no image points" in capsys.readouterr().out


def test_what_is_not_known_is_null(ten, tmp_path, capsys):
    """Control in plan alone has no extent in height, which JSON cannot say by NaN."""
    write_block(with_control(ten, lambda xyz: xyz * [1.0, 1.0, np.nan]), tmp_path / "plan")
    assert invoke(["check", str(tmp_path / "plan"), "--json"]) == 0
    extents = {one["name"]: one for one in json.loads(capsys.readouterr().out)["extents"]}
    assert extents["control"]["low"][2] is None
    assert extents["control"]["low"][0] < extents["control"]["high"][0]


def test_names_without_partner(ten):
    """Image points call the control otherwise: the near names, and the option that makes them meet."""
    names, own = ten.points.astype("U40"), ten.control.point[~ten.control.is_check]
    new = np.full(len(names), -1)
    new[own] = len(names) + np.arange(len(own))
    point = ten.image_points.point
    renamed = replace(
        ten,
        points=np.array([*names, *(f"gcp {name}" for name in names[own])]),
        image_points=replace(ten.image_points, point=np.where(new[point] >= 0, new[point], point)),
    )
    assert inventory(renamed).control.with_image_points == 0
    assert f"control points have no image points: '{names[own[0]]}' (near: 'gcp {names[own[0]]}')" in said(renamed)
    assert '--control-prefix "gcp "' in said(renamed)


def test_points_and_photographs_that_hang_on_nothing(ten):
    rays = ten.image_points
    alone = replace(ten, image_points=replace(rays, image=np.where(rays.image == 9, 8, rays.image)))
    keep = np.unique(np.stack([alone.image_points.image, alone.image_points.point]), axis=1, return_index=True)[1]
    alone = replace(alone, image_points=type(rays)(*(getattr(alone.image_points, name)[keep]
                                                     for name in ("image", "point", "xy", "sigma"))))  # fmt: skip
    assert inventory(alone).without_image_points == ("2_005",)
    assert "1 photograph without image points (2_005)" in said(alone)
    assert "measured in one photograph only" in said(alone)
    apart = with_strips_apart(ten)
    assert "strip '1' has no point in common with another strip" in said(apart)
    assert "the block falls into 2 parts without common points, of 5, 5 photographs" in said(apart)


def test_places_that_do_not_meet(ten):
    """Another zone, X and Y exchanged, photographs below the ground: each is asked about."""
    assert "in the same coordinate system?" in said(with_control(ten, lambda xyz: xyz + [5e5, 0.0, 0.0]))
    away = with_control(with_positions(ten, lambda xyz: xyz + [5e5, 5e6, 0.0]), lambda xyz: xyz + [5e5, 5e6, 0.0])
    checks = away.control.is_check[:, None]
    away = replace(away, control=replace(away.control, xyz=away.control.xyz + np.where(checks, [5e5, 5e6, 0.0], 0.0)))
    assert said(away) == ""
    turned = replace(away, control=replace(away.control, xyz=away.control.xyz[:, [1, 0, 2]]))
    assert "X and Y of one of the two look exchanged" in said(turned)
    assert "are both in metres?" in said(with_positions(ten, lambda xyz: 1000.0 * xyz))
    assert "are both in metres?" in said(with_control(ten, lambda xyz: 1e-5 * xyz))
    assert "not above it" in said(with_positions(ten, lambda xyz: xyz - [0.0, 0.0, 5000.0]))


def test_units_that_cannot_be(ten):
    """Image points in the wrong unit, angles in another one than stated."""
    small = replace(ten, image_points=replace(ten.image_points, xy=ten.image_points.xy * 0.01))
    assert "check image_unit, size_px and pixel_um" in said(small)
    half = np.array(ten.cameras[0].half_format_mm)
    corner = replace(ten, image_points=replace(ten.image_points, xy=ten.image_points.xy * 0.01 - 0.98 * half))
    assert "check image_unit, size_px and pixel_um" in said(corner)
    assert said(with_image_points(ten, 0, lambda xy: 0.01 * xy)) == ""
    as_radians = with_attitudes(ten, lambda angles: angles * np.pi / 180.0)
    assert "half a circle in radians, but angle_unit says degrees" in said(as_radians)
    as_gon = with_attitudes(ten, lambda angles: angles * 200.0 / 180.0)
    assert "half a circle in gon, but angle_unit says degrees" in said(as_gon)


def test_micrometres_and_metres_that_are_millimetres(ten):
    """pixel_um in millimetres, σ of control in millimetres; as they should be nothing is said (the first test)."""
    camera = ten.cameras[0]
    tiny = replace(camera, pixel_um=camera.pixel_um * 1e-3)
    assert "pixel_um is in micrometres" in said(replace(ten, cameras=(tiny, *ten.cameras[1:])))
    sigma = ten.control.sigma.copy()
    sigma[0] *= 1e3
    text = said(replace(ten, control=replace(ten.control, sigma=sigma)))
    assert f"({ten.points[ten.control.point[0]]})" in text
    assert "is σ in metres?" in text


def test_a_fisheye_is_said(ten):
    camera = replace(ten.cameras[0], model="frame", projection="fisheye")
    found = aerotri.check(replace(ten, cameras=(camera,)))
    assert "frame with a fisheye lens" in "\n".join(found.lines())
    assert found.summary["cameras"][0]["projection"] == "fisheye"
    assert "fisheye" not in "\n".join(aerotri.check(ten).lines())


def test_names_that_look_alike():
    assert alike(["GCP-01", "gcp 1", "GCP_2", "1_11", "11_1", "111", "A/IMG_1.jpg", "B/IMG_1.jpg"]) == [
        ("GCP-01", "gcp 1")
    ]
    assert alike(["П1", "P1"]) == []
    assert alike(["Р1", "P1"]) == [("Р1", "P1")]


def test_the_sample_block():
    """As its README has it."""
    found = aerotri.check(SAMPLE)
    assert found.can_be_adjusted
    assert (found.warnings, found.notes) == ((), ())
    counts = found.inventory
    assert (counts.photographs, counts.image_points.count, counts.image_points.points) == (132, 13590, 1783)
    assert (counts.check.count, counts.check.with_image_points) == (40, 40)
